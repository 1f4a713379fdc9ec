"""The corners where the breast leaves the chest, found from the body's outline alone."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Floats
from mammoreg.geometry import Volume

CORNER_FULLNESS = 0.6  # chosen: share of a ball of some 20 mm that the body must fill between breast and chest


def base_corners(body: Volume, apex: Floats) -> tuple[Floats | None, Floats | None]:
    """Lateral and medial corner (m, p) between the breast and the chest, mm; None where there is none.

    In a corner the body fills more than half of a ball. Per axial slice near the apex the skin that is seen from the
    front is searched for local maxima: on the medial side the fullest, where breast and sternum meet; on the lateral
    side the most anterior, since fuller ones follow at the arm. The median over the slices is the corner.
    """
    full = ndimage.gaussian_filter(body.data.astype(np.float32), 12.0 / body.spacing, mode="nearest", truncate=2.5)
    mask = body.data > 0.5
    shadow = np.maximum.accumulate(mask, axis=1)
    skin = mask & ~ndimage.binary_erosion(shadow, border_value=1)
    index = np.rint(body.to_index(apex)).astype(int)
    skin[:, : int(index[1] + 10.0 / body.spacing[1])] = False
    fullness = np.where(skin, full, 0.0)
    size = [2 * int(12.0 / h) + 1 for h in body.spacing[:2]]
    fullness[(fullness < CORNER_FULLNESS) | (fullness < ndimage.maximum_filter(fullness, (*size, 1)))] = 0.0
    half = int(40.0 / body.spacing[2])
    near = slice(max(index[2] - half, 0), index[2] + half + 1)
    anterior = np.arange(body.shape[1], 0.0, -1.0)[None, :, None]
    lateral = np.where(fullness > 0.0, anterior, 0.0)[: index[0], :, near]
    medial = fullness[index[0] :, :, near]
    return _corner(lateral, body, 0), _corner(medial, body, index[0])


def _corner(score: NDArray[Any], body: Volume, first: int) -> Floats | None:
    """Median (m, p) over slices of the voxel with the best score, if at least half of the slices have one above 0."""
    flat = score.reshape(-1, score.shape[2])
    good = flat.max(axis=0, initial=0.0) > 0.0
    if good.mean() < 0.5:
        return None
    m, p = np.unravel_index(np.argmax(flat, axis=0)[good], score.shape[:2])
    return np.array([np.median(m + first), np.median(p)]) * body.spacing[:2] + body.origin[:2]
