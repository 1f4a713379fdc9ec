"""The breast as one smooth region in front of its back."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Bools, Points
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_chest_wall import BackSurface

OPENING_MM = 8.0
"""What a ball of this radius does not fit into is no breast: folds, slivers along the chest."""
NIPPLE_MM = 3.5
"""In the front half a ball of this radius is enough; ghosts beside the skin are thinner."""


def breast_mask(body: Bools, grid: Volume, back: BackSurface, apex: Points) -> Bools:
    """The part of the body in front of the back that hangs together with the apex, smooth to about a voxel.

    Raises:
        DataError: nothing of the body lies in front of the back.
    """
    m, p, s = (grid.origin[k] + grid.spacing[k] * np.arange(grid.shape[k]) for k in range(3))
    ahead = p[None, :, None] < back.posterior(m[:, None], s[None, :])[:, None, :]
    front = body & ahead
    thick = _piece_near(_opened(front, grid.spacing, OPENING_MM), grid, apex)
    halfway = apex[1] + 0.5 * float(back.posterior(apex[0], apex[2]) - apex[1])
    # What lies two balls behind cannot matter to the front half.
    near = int(np.searchsorted(p, halfway + 2.0 * NIPPLE_MM + 2.0 * grid.spacing[1]))
    fine = np.zeros_like(front)
    fine[:, :near] = _opened(front[:, :near], grid.spacing, NIPPLE_MM) & (p[:near] < halfway)[None, :, None]
    with_rim = ndimage.binary_dilation(thick, iterations=3, mask=front)
    with_nipple = ndimage.binary_dilation(with_rim, iterations=4, mask=with_rim | fine)
    return _smooth_skin(with_nipple, ahead)


def _piece_near(mask: Bools, grid: Volume, apex: Points) -> Bools:
    """The connected piece of a mask that fills most of the box of some 30 mm around the apex."""
    label, _ = ndimage.label(mask)
    index, reach = np.rint(grid.to_index(apex)).astype(int), int(17.0 / grid.spacing[0])
    near = label[tuple(slice(max(i - reach, 0), i + reach + 1) for i in index)]
    counts = np.bincount(near[near > 0])
    if counts.size == 0:
        raise DataError("no breast in front of the chest-wall surface: check side and field of view, or give mr_labels")
    return np.asarray(label == int(np.argmax(counts)))


def _smooth_skin(mask: Bools, ahead: Bools) -> Bools:
    """A mask with its skin smoothed over a voxel and its rim at the back left sharp."""
    inside = ndimage.gaussian_filter(mask.astype(np.float32), 1.0, truncate=3.0)
    room = ndimage.gaussian_filter(ahead.astype(np.float32), 1.0, truncate=3.0)
    return np.asarray((inside > 0.5 * room) & ahead, dtype=np.bool_)


def back_points(breast: Bools, grid: Volume, back: BackSurface, step_mm: float = 4.0) -> Points:
    """Points (N, 3) of the back, mm, regular in m and s, wherever the breast lies directly in front of it."""
    step = max(round(step_mm / float(grid.spacing[0])), 1)
    i, k = np.meshgrid(np.arange(0, grid.shape[0], step), np.arange(0, grid.shape[2], step), indexing="ij")
    m, s = grid.origin[0] + grid.spacing[0] * i.ravel(), grid.origin[2] + grid.spacing[2] * k.ravel()
    points = np.stack([m, back.posterior(m, s), s], axis=-1)
    ahead = np.floor(grid.to_index(points)[:, 1] - 0.5).astype(int)
    valid = (ahead >= 0) & (ahead < grid.shape[1])
    valid &= breast[i.ravel(), np.clip(ahead, 0, grid.shape[1] - 1), k.ravel()]
    return points[valid]


def _opened(mask: Bools, spacing: NDArray[np.float64], radius_mm: float) -> Bools:
    """Union of the balls of a radius that fit into a mask; the grid's faces do not bound it."""
    opened = np.zeros_like(mask)
    boxes = ndimage.find_objects(mask.astype(np.uint8))
    if boxes:
        # One voxel beyond the mask is enough to bound it: all that is further out is further away.
        box = tuple(slice(max(s.start - 1, 0), s.stop + 1) for s in boxes[0])
        centres = ndimage.distance_transform_edt(mask[box], sampling=spacing) > radius_mm
        if centres.any():
            opened[box] = ndimage.distance_transform_edt(~centres, sampling=spacing) <= radius_mm
    return opened
