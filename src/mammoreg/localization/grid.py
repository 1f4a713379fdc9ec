"""The breast's voxels in coarse blocks, and where a view shows them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.localization.deformation import MethodView

Cells = NDArray[np.intp]


@dataclass(frozen=True)
class BreastGrid:
    """The undeformed breast as nested cells: blocks of 2 x 2 x 2 voxels, voxels, and halves of those.

    Level 0 are the voxels, level -1 the blocks, level k voxels cut k times in half along every axis. A cell is named
    by three integers, counted from the volume's corner.

    Attributes:
        breast: the breast's mask in the breast frame.
    """

    breast: Volume

    @cached_property
    def blocks(self) -> Cells:
        """Blocks (N, 3) that hold at least one voxel of the breast."""
        return np.asarray(np.unique(np.argwhere(np.asarray(self.breast.data) != 0) // 2, axis=0), dtype=np.intp)

    @cached_property
    def block_centres(self) -> Points:
        """Centres (N, 3) of the blocks, mm."""
        return self.centres(self.blocks, -1)

    def spacing(self, level: int) -> NDArray[np.float64]:
        """Edge lengths (3,) of a level's cells, mm."""
        return np.asarray(self.breast.spacing, dtype=float) * 0.5**level

    def centres(self, cells: Cells, level: int) -> Points:
        """Centres (N, 3) of cells, mm."""
        corner = self.breast.origin - 0.5 * self.breast.spacing
        return np.asarray(corner + (cells + 0.5) * self.spacing(level), dtype=float)

    def children(self, cells: Cells, level: int) -> Cells:
        """The eight halves of each cell; those that are voxels only where they belong to the breast."""
        corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
        halves = (2 * cells[:, None, :] + corners).reshape(-1, 3)
        if level >= 0:
            return np.asarray(halves, dtype=np.intp)
        halves = halves[np.all(halves < self.breast.shape, axis=1)]
        return np.asarray(halves[np.asarray(self.breast.data)[tuple(halves.T)] != 0])

    def holds(self, points: Points) -> NDArray[np.bool_]:
        """Whether points (N, 3), mm, lie in a voxel of the breast; nan does not."""
        finite = np.isfinite(points).all(axis=1)
        inside = np.zeros(len(points), dtype=bool)
        inside[finite] = self.breast.sample(points[finite], order=0) > 0.5
        return inside


@dataclass(frozen=True)
class BreastInView:
    """A view of the breast by one method: where the blocks of the grid appear."""

    method: MethodView
    grid: BreastGrid

    @cached_property
    def plate_points(self) -> Points:
        """Block centres (N, 3) between the plates, plate frame, mm."""
        return self.method.deformation.forward(self.grid.block_centres)

    @cached_property
    def pixels(self) -> NDArray[np.float64]:
        """Block centres (N, 2) on the detector as (column, row)."""
        return self.method.geometry.project(self.plate_points)
