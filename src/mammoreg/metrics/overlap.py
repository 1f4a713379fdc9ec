"""How a predicted lesion covers the true one, in areas or volumes alike."""

from dataclasses import dataclass

import numpy as np

from mammoreg.geometry import Volume
from mammoreg.localization.lesions import LesionArea, MrLesion


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


def overlap_of_volumes(region: Volume | None, true: MrLesion) -> Overlap:
    """Overlap of a region's cells (non-zero) with a lesion of the same frame; no region overlaps by 0."""
    if region is None:
        return overlap_of_sizes(0.0, true.volume_mm3, 0.0)
    cells = region.centres(np.asarray(region.data) != 0)
    shared = float(np.count_nonzero(true.contains(cells)))
    return overlap_of_sizes(len(cells) * region.voxel_mm3, true.volume_mm3, shared * region.voxel_mm3)
