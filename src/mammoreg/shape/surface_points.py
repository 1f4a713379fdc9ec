"""Points on the skin as points of its faces (paper, section II-C: additional surface points)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.meshing.skin import skin_facets

_FACETS = 8


def nearest_on_skin(
    nodes: Points, faces: NDArray[np.integer], points: Points
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Corners (P, 4) and weights (P, 4) of the skin's points nearest to points (P, 3), to an eighth of a face.

    Args:
        nodes: of the mesh (N, 3), mm, in the frame of the points.
        faces: of its skin (F, 4).
        points: on the skin or near it.
    """
    facets = skin_facets(faces, len(nodes), _FACETS)
    found = np.asarray(cKDTree(facets.positions(nodes)).query(points)[1], dtype=np.int64)
    per_face = facets.interpolation.shape[0] // len(faces)
    corners = np.asarray(faces, dtype=np.int64)[found // per_face]
    rows = facets.interpolation[found]
    weights = np.stack([np.asarray(rows[np.arange(len(points)), corners[:, c]]).ravel() for c in range(4)], axis=-1)
    return corners, weights
