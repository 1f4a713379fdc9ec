"""The breast as one smooth region in front of its back."""

import numpy as np
from scipy import ndimage

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Points
from mammoreg.imaging.mr_body import Mask
from mammoreg.imaging.mr_chest_wall import BackSurface


def breast_mask(body: Mask, grid: Volume, back: BackSurface, apex: Points) -> Mask:
    """The part of the body in front of the back that hangs together with the apex, smooth to about a voxel.

    Raises:
        DataError: nothing of the body lies in front of the back.
    """
    m, p, s = (grid.origin[k] + grid.spacing[k] * np.arange(grid.shape[k]) for k in range(3))
    limit = back.posterior(m[:, None], s[None, :])
    distance = np.clip((limit[:, None, :] - p[None, :, None]) / grid.spacing[1] + 0.5, 0.0, 1.0)
    front = body & (distance > 0.5)
    opened = ndimage.binary_opening(front, _ball(round(6.0 / float(grid.spacing[0]))))
    label, count = ndimage.label(opened)
    if count == 0:
        raise DataError("nothing of the body lies in front of the chest-wall surface")
    index = np.rint(grid.to_index(apex)).astype(int)
    near = label[tuple(slice(max(i - 12, 0), i + 13) for i in index)]
    kept = label == np.argmax(np.bincount(near[near > 0], minlength=2)[1:]) + 1
    grown = ndimage.binary_dilation(kept, iterations=4, mask=front)
    soft = ndimage.gaussian_filter(grown.astype(np.float32), 1.0, truncate=3.0)
    return np.asarray((soft > 0.5) & (distance > 0.5), dtype=np.bool_)


def back_points(breast: Mask, grid: Volume, back: BackSurface, step_mm: float = 4.0) -> Points:
    """Points (N, 3) of the back, mm, regular in m and s, wherever the breast lies directly in front of it."""
    step = max(round(step_mm / float(grid.spacing[0])), 1)
    i, k = np.meshgrid(np.arange(0, grid.shape[0], step), np.arange(0, grid.shape[2], step), indexing="ij")
    m, s = grid.origin[0] + grid.spacing[0] * i.ravel(), grid.origin[2] + grid.spacing[2] * k.ravel()
    points = np.stack([m, back.posterior(m, s), s], axis=-1)
    ahead = np.floor(grid.to_index(points)[:, 1] - 0.5).astype(int)
    valid = (ahead >= 0) & (ahead < grid.shape[1])
    valid &= breast[i.ravel(), np.clip(ahead, 0, grid.shape[1] - 1), k.ravel()]
    return points[valid]


def _ball(radius: int) -> Mask:
    """Ball of a radius in voxels."""
    reach = np.arange(-radius, radius + 1)
    return np.asarray((reach[:, None, None] ** 2 + reach[None, :, None] ** 2 + reach[None, None, :] ** 2) <= radius**2)
