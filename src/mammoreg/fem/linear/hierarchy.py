"""Structured blocks of hexahedra as grids of a hierarchy: node stencils, and interpolation between grid sizes.

Nodes and elements are numbered as in `mammoreg.meshing.block.BlockMesh`. Interpolation is trilinear in the nodes'
indices, so that grids of any two sizes can be related; where one size divides the other the coarse functions are those
of the fine grid's own subdivision.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.meshing.block import BlockMesh

Number = TypeVar("Number", bound=np.generic)

CORNERS = ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0))
"""Offsets (k, j, i) of a hexahedron's corners in VTK order."""
COARSENING = 3
LEAST_COARSE = 4


@dataclass(frozen=True)
class Hierarchy:
    """Two grids of one block.

    Attributes:
        fine, coarse: elements a side.
    """

    fine: int
    coarse: int

    @classmethod
    def of(cls, hexes: NDArray[np.integer]) -> "Hierarchy | None":
        """The hierarchy of a mesh (E, 8); None unless it is a structured block that can be made coarser."""
        n = block_size(hexes)
        if n is None or round(n / COARSENING) < LEAST_COARSE:
            return None
        return cls(n, round(n / COARSENING))

    @property
    def nodes(self) -> int:
        """Nodes of the fine grid."""
        return (self.fine + 1) ** 3

    def interpolation(self) -> sp.csr_array:
        """Nodal values of the fine grid from those of the coarse one."""
        return interpolation(self.fine, self.coarse)

    def coincident(self) -> Integers:
        """The fine node at, or next to, each coarse node ((coarse + 1)^3,)."""
        line = np.rint(np.arange(self.coarse + 1) * self.fine / self.coarse).astype(np.int64)
        return np.asarray(_grid(self.fine)[np.ix_(line, line, line)].ravel())

    def stencil(self) -> NDArray[np.int32]:
        """The 27 neighbours of each fine node, flat (27 nodes,); a node itself stands for those beyond the border."""
        m, grid = self.fine + 1, _grid(self.fine)
        found = np.empty((m, m, m, 27), dtype=np.int32)
        found[:] = grid[..., None]
        for number, shift in enumerate(np.ndindex(3, 3, 3)):
            here = tuple(slice(max(0, 1 - s), m - max(0, s - 1)) for s in shift)
            there = tuple(slice(max(0, s - 1), m - max(0, 1 - s)) for s in shift)
            found[..., number][here] = grid[there]
        return found.ravel()

    def stencil_values(self, blocks: Floats, left: Floats, right: Floats) -> Floats:
        """Element matrices less dyads, B - l r^T, summed as 3 x 3 blocks (27 nodes, 3, 3) of the stencil.

        Args:
            blocks: B (E, 24, 24).
            left, right: l and r (E, 24).
        """
        n, m = self.fine, self.fine + 1
        values = np.zeros((m, m, m, 27, 3, 3))
        for k in range(n):
            layer = slice(n * n * k, n * n * (k + 1))
            less = blocks[layer] - left[layer, :, None] * right[layer, None, :]
            elements = less.reshape(n, n, 8, 3, 8, 3)
            for a, (up, along, across) in enumerate(CORNERS):
                for b, other in enumerate(CORNERS):
                    number = 9 * (other[0] - up + 1) + 3 * (other[1] - along + 1) + other[2] - across + 1
                    values[k + up, along : along + n, across : across + n, number] += elements[:, :, a, :, b, :]
        return values.reshape(-1, 3, 3)


def block_size(hexes: NDArray[np.integer]) -> int | None:
    """Elements a side of a mesh (E, 8) if it is a structured block with the numbering of `BlockMesh`."""
    n = round(len(hexes) ** (1.0 / 3.0))
    if n**3 != len(hexes):
        return None
    structured = BlockMesh(n, np.zeros(((n + 1) ** 3, 3))).hexes()
    return n if np.array_equal(structured, hexes) else None


def interpolation(fine: int, coarse: int) -> sp.csr_array:
    """Trilinear interpolation ((fine + 1)^3, (coarse + 1)^3) of nodal values between block grids, by node index."""
    line = _line(fine, coarse)
    return sp.csr_array(sp.kron(line, sp.kron(line, line)))


def interpolate_elements(values: NDArray[Number], fine: int, coarse: int) -> NDArray[Number]:
    """Element values (coarse^3,) on another grid (fine^3,): those of the element around each centre."""
    parent = ((np.arange(fine) + 0.5) * coarse / fine).astype(np.int64)
    return values.reshape(coarse, coarse, coarse)[np.ix_(parent, parent, parent)].ravel()


def _line(fine: int, coarse: int) -> sp.csr_array:
    place = np.arange(fine + 1) * coarse / fine
    cell = np.minimum(place.astype(np.int64), coarse - 1)
    weight = np.concatenate([1.0 - (place - cell), place - cell])
    row = np.tile(np.arange(fine + 1), 2)
    line = sp.csr_array((weight, (row, np.concatenate([cell, cell + 1]))), shape=(fine + 1, coarse + 1))
    line.eliminate_zeros()
    return line


def _grid(n: int) -> Integers:
    """Node numbers indexed [k, j, i]."""
    return np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
