"""Points of the skin that can be found again between the plates."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.phantom.mesh import PhantomMesh


def skin_points(mesh: PhantomMesh, count: int) -> NDArray[np.int64]:
    """Numbers (count,) of skin nodes, each as far as possible from those before it; the first lies foremost."""
    nodes = np.setdiff1d(mesh.skin_quads, mesh.back)
    places = mesh.points[nodes]
    chosen = [int(places[:, 1].argmin())]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return nodes[chosen]
