"""A structured block of n x n x n hexahedra."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.geometry.frames import Laterality
from mammoreg.meshing.trilinear import shape_functions

# Swapping the ends of the first axis makes the elements of a mirrored block right-handed again.
_MIRRORED_CORNERS = [1, 0, 3, 2, 5, 4, 7, 6]


@dataclass(frozen=True)
class BlockMesh:
    """Nodes of a hexahedral block in the breast frame.

    Node (i, j, k) has the number i + (n + 1) (j + (n + 1) k); i runs from lateral to medial, j from inferior to
    superior, k from the chest wall to the nipple, so that Jacobians are positive.

    Attributes:
        n: elements a side.
        points: node positions, shape ((n + 1)^3, 3), mm.
    """

    n: int
    points: Floats

    def __post_init__(self) -> None:
        if self.points.shape != ((self.n + 1) ** 3, 3):
            raise ValueError(f"{self.n} elements a side need {(self.n + 1) ** 3} points, got {self.points.shape}")

    def node_grid(self) -> Integers:
        """Node numbers as an array indexed [i, j, k], shape (n + 1, n + 1, n + 1)."""
        m = self.n + 1
        return np.arange(m**3).reshape(m, m, m).transpose(2, 1, 0)

    def hexes(self) -> Integers:
        """Connectivity (n^3, 8) in VTK order; element (a, b, c) has the number a + n (b + n c)."""
        grid = self.node_grid()
        low, high = slice(None, -1), slice(1, None)
        corners = [(low, low), (high, low), (high, high), (low, high)]
        cells = [grid[i, j, k] for k in (low, high) for i, j in corners]
        return np.stack([cell.ravel(order="F") for cell in cells], axis=1)

    def lps_hexes(self, laterality: Laterality) -> Integers:
        """Connectivity with positive Jacobians in LPS, where the block of a left breast is mirrored."""
        return self.hexes() if laterality == "R" else self.hexes()[:, _MIRRORED_CORNERS]

    def back_nodes(self) -> Integers:
        """Nodes ((n + 1)^2,) of the back face (k = 0), rim included."""
        return self.node_grid()[:, :, 0].ravel(order="F")

    def skin_nodes(self) -> Integers:
        """Sorted nodes of the five faces other than the back; the back's rim is among them."""
        return np.unique(self.skin_quads())

    def rim(self) -> NDArray[np.bool_]:
        """Which nodes ((n + 1)^3,) lie where skin and back meet: the skin goes on there, the mesh does not."""
        inside = np.zeros(len(self.points), dtype=bool)
        inside[np.intersect1d(self.skin_nodes(), self.back_nodes())] = True
        return inside

    def skin_quads(self) -> Integers:
        """Quadrilaterals (5 n^2, 4) of the skin with outward normals: -i, +i, -j, +j faces and the cap."""
        grid = self.node_grid()
        faces = [grid[0].T, grid[-1], grid[:, 0], grid[:, -1].T, grid[:, :, -1]]
        return np.concatenate([_quads(face) for face in faces])

    def back_quads(self) -> Integers:
        """Quadrilaterals (n^2, 4) of the back face with outward normals."""
        return _quads(self.node_grid()[:, :, 0].T)

    def subdivide(self, k: int) -> "BlockMesh":
        """The mesh whose every hexahedron is cut into k x k x k by its own trilinear map."""
        if k < 1:
            raise ValueError(f"cannot cut elements into {k} parts")
        steps = np.arange(self.n * k + 1)
        cell = np.minimum(steps // k, self.n - 1)
        local = 2.0 * (steps - cell * k) / k - 1.0
        c, b, a = np.meshgrid(cell, cell, cell, indexing="ij")
        z, y, x = np.meshgrid(local, local, local, indexing="ij")
        element = a + self.n * (b + self.n * c)
        weights = shape_functions(np.stack([x, y, z], axis=-1).reshape(-1, 3))
        points = np.einsum("pa,pac->pc", weights, self.points[self.hexes()[element.ravel()]])
        return BlockMesh(self.n * k, points)

    def skin_points(self, k: int) -> Floats:
        """Points (N, 3) on the skin, mm: its nodes and those that cut every face into k x k."""
        fine = self.subdivide(k)
        return np.asarray(fine.points[fine.skin_nodes()])


def _quads(face: Integers) -> Integers:
    """Quadrilaterals of a face of nodes [u, v]; normals along u x v."""
    corners = [face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]]
    return np.stack([corner.ravel() for corner in corners], axis=1)
