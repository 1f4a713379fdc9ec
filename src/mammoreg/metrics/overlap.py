"""How a predicted lesion covers the true one, in areas or volumes alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.localization.lesions import LesionArea


@dataclass(frozen=True)
class Overlap:
    """Overlap of a predicted with a true region.

    Attributes:
        overlap_percent: 100 |predicted and true| / |true|, the paper's coverage.
        dice: 2 |predicted and true| / (|predicted| + |true|).
        size_ratio: |predicted| / |true|, of areas or volumes.
    """

    overlap_percent: float
    dice: float
    size_ratio: float


def overlap_of_sizes(predicted: float, true: float, shared: float) -> Overlap:
    """Overlap from the sizes of both regions and of their intersection, any one unit.

    Raises:
        ValueError: if the true region is empty.
    """
    if not true > 0:
        raise ValueError("the true region is empty")
    return Overlap(100.0 * shared / true, 2.0 * shared / (predicted + true), predicted / true)


def overlap_of_areas(predicted: LesionArea | None, true: LesionArea) -> Overlap:
    """Overlap of two areas of one image; nothing predicted overlaps by 0."""
    if predicted is None:
        return overlap_of_sizes(0, true.pixels, 0)
    rows, columns = np.nonzero(predicted.mask)
    pixels = np.stack([columns, rows], axis=1) + np.array(predicted.first, dtype=float)
    return overlap_of_sizes(predicted.pixels, true.pixels, int(np.count_nonzero(true.contains(pixels))))


def overlap_with_mask(region: Volume | None, true: Volume) -> Overlap:
    """Overlap of a region with a mask on another grid of the same frame; each region cell asks the mask's voxel."""
    true_mm3 = float(np.count_nonzero(true.data)) * true.voxel_mm3
    if region is None:
        return overlap_of_sizes(0.0, true_mm3, 0.0)
    cells = region.centres(np.asarray(region.data) != 0)
    index = np.rint(true.to_index(cells)).astype(np.intp)
    inside = np.all((index >= 0) & (index < true.shape), axis=1)
    held = np.asarray(true.data)[tuple(index[inside].T)] != 0
    return overlap_of_sizes(len(cells) * region.voxel_mm3, true_mm3, float(np.count_nonzero(held)) * region.voxel_mm3)


def overlap_with_sphere(region: Volume | None, centre: NDArray[np.float64], diameter_mm: float) -> Overlap:
    """Overlap of a region with a sphere of the same frame."""
    true_mm3 = np.pi / 6.0 * diameter_mm**3
    if region is None:
        return overlap_of_sizes(0.0, true_mm3, 0.0)
    cells = region.centres(np.asarray(region.data) != 0)
    held = np.linalg.norm(cells - centre, axis=1) <= 0.5 * diameter_mm
    return overlap_of_sizes(len(cells) * region.voxel_mm3, true_mm3, float(np.count_nonzero(held)) * region.voxel_mm3)
