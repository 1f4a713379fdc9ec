"""Displacement fields on regular grids: what a mesh says within, continued smoothly beyond its surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Laterality
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.locate import Locator, interpolate
from mammoreg.meshing.trilinear import shape_gradients

_SURFACE_PARTS = 4
"""Pieces of an element's edge between the points at which the field is continued."""
_BAND_VOXELS = 3.0
"""How far the field goes on along its gradient at the surface: a linear interpolation there needs one voxel."""
_STEEPEST = 2.0
"""Largest displacement gradient that is gone on along, so that a folded corner does not throw its neighbours."""
_SMOOTHED_VOXELS = 3.0
_APART_VOXELS = 1.25
"""Distance of the points that tell which voxels hold a part of the mesh; each stands for its neighbours too."""


@dataclass(frozen=True)
class DisplacementField:
    """Displacement vectors on a regular grid.

    Attributes:
        inside: mask, 1 where the voxel's centre lies in the mesh and the vectors are the mesh's own; it is the grid.
        vectors: displacements (nx, ny, nz, 3) in the grid's frame, mm.
    """

    inside: Volume
    vectors: NDArray[np.float32]

    def to_lps(self, laterality: Laterality) -> "DisplacementField":
        """The same field of the breast frame in LPS: mirrored in x for a left breast."""
        mirrored = self.vectors[::-1] * np.array([-1.0, 1.0, 1.0], dtype=np.float32)
        return DisplacementField(self.inside.to_lps(laterality), self.vectors if laterality == "R" else mirrored)


class MeshGrid:
    """A regular grid around a block mesh that knows where in the mesh each of its voxels lies.

    Attributes:
        block: the mesh, breast frame, mm.
        inside: mask of the voxels whose centres lie in the mesh; it is the grid.
    """

    def __init__(self, block: BlockMesh, spacing_mm: float, margin_mm: float) -> None:
        """Lay a grid of cubic voxels over the mesh and a margin."""
        self.block = block
        self._hexes = block.hexes()
        self._locator = Locator(block.points, self._hexes)
        low, high = block.points.min(axis=0) - margin_mm, block.points.max(axis=0) + margin_mm
        shape = np.ceil((high - low) / spacing_mm).astype(int) + 1
        grid = Volume(np.zeros(shape, dtype=np.uint8), low, np.full(3, spacing_mm))
        near = _near(grid, block)
        element, local, held = self._locator.locate(grid.centres(near))
        self._element, self._local = element[held], local[held]
        near[near] = held
        self.inside = grid.with_data(near.astype(np.uint8))
        self._lay_band()

    def _lay_band(self) -> None:
        """Find the voxels close to the surface from outside, and for each the nearest of points on it."""
        self._away = np.asarray(ndimage.distance_transform_edt(self.inside.data == 0))
        self._band = (self._away > 0) & (self._away <= _BAND_VOXELS)
        beyond = self._away > _BAND_VOXELS
        _, self._nearest_known = ndimage.distance_transform_edt(beyond, return_indices=True)
        fine = self.block.subdivide(_SURFACE_PARTS)
        surface = fine.points[np.union1d(fine.skin_nodes(), fine.back_nodes())]
        centres = self.inside.centres(self._band)
        _, nearest = cKDTree(surface).query(centres)
        used, self._foot = np.unique(nearest, return_inverse=True)
        self._foot_element, self._foot_local, _ = self._locator.locate(surface[used])
        self._foot_local = np.clip(self._foot_local, -1.0, 1.0)
        self._beside = centres - surface[used][self._foot]

    def displacement(self, end: Points) -> DisplacementField:
        """The field that carries the mesh to nodes `end` ((n + 1)^3, 3), mm, of the same frame.

        Within the mesh it is the mesh's own. For three voxels beyond the surface it goes on along its gradient there,
        then with the nearest of these values, the more smoothed the farther away.
        """
        moved = end - self.block.points
        vectors = np.zeros((*self.inside.shape, 3))
        vectors[self.inside.data != 0] = interpolate(self._hexes, self._element, self._local, moved)
        at_foot = interpolate(self._hexes, self._foot_element, self._foot_local, moved)
        slope = self._slopes(moved)
        vectors[self._band] = at_foot[self._foot] + np.einsum("nij,nj->ni", slope[self._foot], self._beside)
        filled = vectors[tuple(self._nearest_known)]
        smooth = ndimage.gaussian_filter(filled, (*[_SMOOTHED_VOXELS] * 3, 0.0), mode="nearest")
        share = np.clip((self._away - _BAND_VOXELS) / _SMOOTHED_VOXELS, 0.0, 1.0)[..., None]
        return DisplacementField(self.inside, ((1.0 - share) * filled + share * smooth).astype(np.float32))

    def _slopes(self, moved: Points) -> NDArray[np.float64]:
        """Gradients (F, 3, 3) of nodal displacements at the points of the surface, bounded."""
        gradients = shape_gradients(self._foot_local)
        nodes = self._hexes[self._foot_element]
        before, by_local = (
            np.einsum("nac,nad->ncd", values[nodes], gradients) for values in (self.block.points, moved)
        )
        slope = by_local @ np.linalg.pinv(before)
        size = np.linalg.norm(slope, axis=(1, 2), keepdims=True)
        return np.asarray(slope * np.minimum(1.0, _STEEPEST / np.maximum(size, _STEEPEST)))


def _near(grid: Volume, block: BlockMesh) -> NDArray[np.bool_]:
    """Voxels that hold a part of the mesh, and their neighbours."""
    nodes = block.points[block.node_grid()]
    longest = max(float(np.linalg.norm(np.diff(nodes, axis=axis), axis=-1).max()) for axis in range(3))
    parts = int(np.ceil(longest / (_APART_VOXELS * grid.spacing.min())))
    index = np.rint(grid.to_index(block.subdivide(parts).points)).astype(np.intp)
    held = np.zeros(grid.shape, dtype=bool)
    held[tuple(index.T)] = True
    return np.asarray(ndimage.binary_dilation(held, np.ones((3, 3, 3), dtype=bool)))
