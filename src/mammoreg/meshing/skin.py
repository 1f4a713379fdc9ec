"""The skin of a block mesh as finer facets, tied to the nodes of the block."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mammoreg.arrays import Points


@dataclass(frozen=True)
class SkinFacets:
    """Bilinear faces of a mesh, each cut into k x k facets.

    Attributes:
        interpolation: (M, N) matrix from mesh nodes to facet corners.
        quads: facets (Q, 4) by corner numbers, oriented as the faces.
        rim: which corners (M,) lie on the surface's open edge, where the skin goes on beyond the mesh.
    """

    interpolation: sparse.csr_array
    quads: NDArray[np.intp]
    rim: NDArray[np.bool_]

    def positions(self, nodes: Points) -> Points:
        """Facet corners (M, 3) of mesh nodes (N, 3)."""
        return np.asarray(self.interpolation @ nodes)


def skin_facets(faces: NDArray[np.integer], node_count: int, k: int) -> SkinFacets:
    """Cut quadrilaterals (F, 4) of a mesh with `node_count` nodes into k x k facets each.

    Corners on a common edge of two faces appear once for each face.
    """
    r, s = (g.ravel() for g in np.meshgrid(np.linspace(0.0, 1.0, k + 1), np.linspace(0.0, 1.0, k + 1), indexing="ij"))
    shape = np.stack([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s], axis=-1)
    per_face = len(shape)
    rows = np.repeat(np.arange(len(faces) * per_face), 4)
    columns = np.repeat(faces[:, None, :], per_face, axis=1).ravel()
    values = np.broadcast_to(shape, (len(faces), per_face, 4)).ravel()
    matrix = sparse.csr_array((values, (rows, columns)), shape=(len(faces) * per_face, node_count))
    corner = np.arange(per_face).reshape(k + 1, k + 1)
    cell = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    quads = (cell[None] + per_face * np.arange(len(faces))[:, None, None]).reshape(-1, 4)
    sides = np.stack([s == 0.0, r == 1.0, s == 1.0, r == 0.0])
    rim = (_open_edges(faces) @ sides).ravel()
    return SkinFacets(matrix, quads.astype(np.intp), rim)


def _open_edges(faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Which edges (F, 4) of quadrilaterals, the first from corner 0 to 1, belong to no other."""
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    _, inverse, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()] == 1).reshape(faces.shape)
