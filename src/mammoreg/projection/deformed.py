"""The deformed breast on a regular grid of the plate frame."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.meshing.locate import Locator, interpolate
from mammoreg.projection.regular import interpolate_axis

_COARSER = 3
_SHELL_MM = 6.0
_KNOWN_SHARE = 0.5
_SIX_NEIGHBOURS = ndimage.generate_binary_structure(3, 1).astype(np.int8)
_MOST_NEIGHBOURS = 5


@dataclass(frozen=True)
class PlateGrid:
    """A regular grid of the plate frame.

    Attributes:
        origin: centre of the first voxel (3,), mm.
        spacing_mm: distance of voxels along every axis.
        shape: number of voxels along every axis, 3 m + 1, so that every third one forms a grid too.
    """

    origin: NDArray[np.float64]
    spacing_mm: float
    shape: tuple[int, int, int]

    def volume(self, samples: NDArray[np.float32]) -> Volume:
        """Samples of this grid as a volume."""
        return Volume(samples, self.origin, np.full(3, self.spacing_mm), "plate")


def grid_around(points: Points, spacing_mm: float, margin_mm: float = _SHELL_MM) -> PlateGrid:
    """The grid that holds points (N, 3), mm, with a margin around them."""
    low, high = points.min(axis=0) - margin_mm, points.max(axis=0) + margin_mm
    thirds = np.ceil((high - low) / (_COARSER * spacing_mm)).astype(int)
    nx, ny, nz = (int(_COARSER * third + 1) for third in thirds)
    return PlateGrid(np.asarray(low, dtype=float), spacing_mm, (nx, ny, nz))


def undeformed_positions(inverse: Callable[[Points], Points], grid: PlateGrid) -> NDArray[np.float32]:
    """Where the voxels of a grid came from, (nx, ny, nz, 3), mm: an inverse map sampled coarsely, then interpolated.

    Within an element the inverse is smooth, so that every third voxel is enough (a test holds it to 0.1 mm). Samples
    without an answer are continued from their neighbours, and the border between both is interpolated too: otherwise
    it would show the coarse samples as steps.

    Args:
        inverse: maps points (N, 3) of the plate frame to the breast frame, nan where there is no breast.
        grid: of the plate frame.
    """
    coarse = tuple((size - 1) // _COARSER + 1 for size in grid.shape)
    indices = np.stack(np.meshgrid(*(np.arange(size) for size in coarse), indexing="ij"), axis=-1)
    points = grid.origin + _COARSER * grid.spacing_mm * indices.reshape(-1, 3)
    field: NDArray[np.float32] = inverse(points).astype(np.float32).reshape(*coarse, 3)
    known = _closed(np.asarray(np.isfinite(field).all(axis=-1)))
    samples = np.concatenate([_continued(field, points.reshape(*coarse, 3)), known[..., None]], axis=-1)
    for axis, size in enumerate(grid.shape):
        samples = interpolate_axis(samples.astype(np.float32), np.arange(size) / _COARSER, axis)
    return np.where(samples[..., 3:] >= _KNOWN_SHARE, samples[..., :3], np.float32(np.nan))


def _closed(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Known samples, with holes of single samples inside the breast closed."""
    around = ndimage.convolve(known.astype(np.int8), _SIX_NEIGHBOURS, mode="constant")
    return np.asarray(known | (around >= _MOST_NEIGHBOURS))


def _continued(field: NDArray[np.float32], points: Points) -> NDArray[np.float32]:
    """The field with unknown samples displaced as the nearest known one is."""
    known = np.asarray(np.isfinite(field).all(axis=-1))
    if known.all() or not known.any():
        return field
    _, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
    displacement = (field - points)[tuple(nearest)]
    return np.where(known[..., None], field, (points + displacement).astype(np.float32))


class MeshInverse:
    """Inverse of a finite element solution, continued through the thin shell of tissue that the mesh leaves out."""

    def __init__(self, points: Points, deformed: Points, hexes: NDArray[np.integer]) -> None:
        """Prepare nodes (N, 3), breast frame, the same between the plates (N, 3), plate frame, mm, and (E, 8)."""
        self._points, self._deformed, self._hexes = points, deformed, np.asarray(hexes, dtype=np.int64)
        self._locator = Locator(deformed, self._hexes)
        self._low, self._high = deformed.min(axis=0) - _SHELL_MM, deformed.max(axis=0) + _SHELL_MM

    def __call__(self, points: Points) -> Points:
        """Carry points (N, 3) of the plate frame to the breast frame; nan more than 6 mm off the mesh."""
        result = np.full(points.shape, np.nan)
        near = np.flatnonzero(np.all((points >= self._low) & (points <= self._high), axis=1))
        element, local, _ = self._locator.locate(points[near])
        reached = interpolate(self._hexes, element, local, self._deformed)
        result[near] = interpolate(self._hexes, element, local, self._points)
        on_mesh = np.clip(local, -1.0, 1.0)
        off = np.linalg.norm(points[near] - interpolate(self._hexes, element, on_mesh, self._deformed), axis=1)
        # Extrapolation is bounded: beyond it the tissue is carried along as it is.
        result[near] += points[near] - reached
        result[near[off > _SHELL_MM]] = np.nan
        return result


def resample(source: Volume, positions: NDArray[np.float32]) -> NDArray[np.float32]:
    """A volume of the breast frame at undeformed positions (nx, ny, nz, 3), mm; zero where they are nan."""
    known = np.isfinite(positions).all(axis=-1)
    samples = np.zeros(positions.shape[:-1], dtype=np.float32)
    samples[known] = source.sample(positions[known].astype(float))
    return samples
