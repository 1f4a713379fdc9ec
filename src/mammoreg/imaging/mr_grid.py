"""Grids on which MR volumes are worked on: block means for a first look, a regular working grid for the rest."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.geometry import Volume

Box = tuple[NDArray[np.float64], NDArray[np.float64]]


def block_mean(volume: Volume, target_mm: float) -> Volume:
    """Mean over blocks of whole voxels of about `target_mm` a side; trailing voxels that fill no block are dropped."""
    factors = np.maximum(np.rint(target_mm / volume.spacing), 1).astype(int)
    factors = np.minimum(factors, volume.shape)
    counts = np.array(volume.shape) // factors
    trimmed = volume.data[tuple(slice(0, c * f) for c, f in zip(counts, factors, strict=True))]
    shape = [n for pair in zip(counts, factors, strict=True) for n in pair]
    means = trimmed.reshape(shape).mean(axis=(1, 3, 5), dtype=np.float32)
    origin = volume.origin + 0.5 * (factors - 1) * volume.spacing
    return Volume(means, origin, volume.spacing * factors, volume.frame)


def working_volume(volume: Volume, box: Box, spacing_mm: float) -> Volume:
    """Resample the part of a volume inside a box (lower, upper corner, mm) to an isotropic grid.

    The grid is anchored at the first voxel centre, so a volume that already has this spacing keeps its samples.
    Where the grid is coarser than the volume, a Gaussian takes out what it cannot show.
    """
    lower = np.maximum(box[0], volume.origin)
    upper = np.minimum(box[1], volume.to_world(np.array(volume.shape) - 1))
    first = np.ceil((lower - volume.origin) / spacing_mm - 1e-3).astype(int)
    last = np.floor((upper - volume.origin) / spacing_mm + 1e-3).astype(int)
    origin = volume.origin + first * spacing_mm
    part = _part(volume, origin, volume.origin + last * spacing_mm)
    ratio = spacing_mm / part.spacing
    sigma = 0.5 * np.sqrt(np.maximum(ratio**2 - 1.0, 0.0))
    smooth = ndimage.gaussian_filter(part.data.astype(np.float32), np.where(sigma < 0.2, 0.0, sigma), truncate=3.0)
    index = part.to_index(origin)
    data = ndimage.affine_transform(
        smooth, ratio, offset=index, output_shape=tuple(last - first + 1), order=1, mode="nearest"
    )
    return Volume(data.astype(np.float32), origin, np.full(3, spacing_mm), volume.frame)


def nearest_labels(labels: Volume, grid: Volume) -> NDArray[np.uint8]:
    """Labels at the voxels of another grid, by nearest neighbour."""
    scale = grid.spacing / labels.spacing
    found = ndimage.affine_transform(
        labels.data.astype(np.uint8), scale, offset=labels.to_index(grid.origin), output_shape=grid.shape, order=0
    )
    return np.asarray(found, dtype=np.uint8)


def _part(volume: Volume, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> Volume:
    """Voxels that surround a box, with two more on each side for interpolation and smoothing."""
    start = np.clip(np.floor(volume.to_index(lower)).astype(int) - 2, 0, None)
    stop = np.minimum(np.ceil(volume.to_index(upper)).astype(int) + 3, volume.shape)
    data = volume.data[tuple(slice(a, b) for a, b in zip(start, stop, strict=True))]
    return Volume(data, volume.to_world(start), volume.spacing, volume.frame)
