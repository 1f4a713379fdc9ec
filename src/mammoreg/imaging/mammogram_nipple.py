"""The nipple in the outline of a mammogram, where it stands out in profile."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

_SMOOTH_MM = 2.0
_BASE_MM = 6.0
_LEAST_PROTRUSION_MM = 0.6
_FRONT_SHARE = 0.75


def nipple_in_outline(
    outline: NDArray[np.float64], weight: NDArray[np.float64], pixel_mm: float
) -> NDArray[np.float64] | None:
    """Position (2,) of the nipple as (column, row) on an outline (M, 2), or None where none stands out.

    The outline is compared with itself smoothed over the width of an areola: the nipple is the largest protrusion in
    the front of the breast, if it exceeds the outline's usual one by 0.6 mm; a flatter one is as often a fold.
    """
    step = float(np.mean(np.linalg.norm(np.diff(outline, axis=0), axis=1))) * pixel_mm
    fine = ndimage.gaussian_filter1d(outline, _SMOOTH_MM / step, axis=0, mode="nearest")
    base = ndimage.gaussian_filter1d(outline, _BASE_MM / step, axis=0, mode="nearest")
    tangent = np.gradient(base, axis=0)
    outward = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1)[:, None]
    protrusion = np.einsum("ij,ij->i", fine - base, outward) * pixel_mm
    protrusion -= np.median(protrusion)
    eligible = (outline[:, 0] >= _FRONT_SHARE * outline[:, 0].max()) & (weight >= 1.0)
    best = int(np.argmax(np.where(eligible, protrusion, -np.inf)))
    if not eligible.any() or protrusion[best] < _LEAST_PROTRUSION_MM:
        return None
    return np.asarray(outline[best], dtype=float)
