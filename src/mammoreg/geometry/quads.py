"""Areas of quadrilaterals."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points


def area_vectors(points: Points, quads: NDArray[np.integer]) -> Points:
    """Normals (F, 3) as long as the areas of faces (F, 4), in mm2 of nodes (N, 3) in mm."""
    corners = points[quads]
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def node_area_vectors(points: Points, quads: NDArray[np.integer]) -> Points:
    """Quarters (N, 3) of the area vectors of the faces (F, 4) around each node, zero elsewhere."""
    areas = np.zeros_like(points)
    np.add.at(areas, quads.ravel(), np.repeat(0.25 * area_vectors(points, quads), 4, axis=0))
    return areas
