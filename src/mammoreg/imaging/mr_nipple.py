"""The nipple on the skin of a breast in an MR volume."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import feature

from mammoreg.arrays import Bools, Floats, Points
from mammoreg.geometry import Volume

FRONT_SHARE = 0.22
"""The nipple lies at most this share of the breast's depth behind the most anterior point, not further."""
DISTANCE_MM = 40.0
"""Distance from the most anterior point at which the prior takes one standard deviation from a spot's score."""


def find_nipple(
    volume: Volume, body: Bools, depth: NDArray[np.float32], fat_suppressed: bool, apex: Points, breast_depth: float
) -> Points:
    """Place on the front of the breast, mm, that bulges most and has most duct-like tissue beneath.

    Two maps seen from the front, each searched for spots that stand out in every direction: how little of a ball at the
    skin the body fills (the bulge), and how unlike fat the first 2 to 8 mm below the skin are (nipple and ducts).

    Args:
        volume: bias-corrected MR volume of the breast frame.
        body: body against air.
        depth: distance below the skin, mm.
        fat_suppressed: whether fat is dark.
        apex: most anterior point of the breast, mm.
        breast_depth: from the apex to the breast's back, mm.
    """
    skin = _skin_index(body)
    m = volume.origin[0] + volume.spacing[0] * np.arange(volume.shape[0])
    s = volume.origin[2] + volume.spacing[2] * np.arange(volume.shape[2])
    p = volume.origin[1] + volume.spacing[1] * skin
    distance = np.hypot(m[:, None] - apex[0], s[None, :] - apex[2])
    front = _piece_at((p < apex[1] + FRONT_SHARE * breast_depth) & (distance < 2.0 * DISTANCE_MM), volume, apex)
    ducts = _below_skin(volume, depth, skin) * (1.0 if fat_suppressed else -1.0)
    score = _spot(_bulge(body, volume.spacing, skin), front, volume.spacing[0])
    score += _spot(ducts, front, volume.spacing[0])
    score -= (distance / DISTANCE_MM) ** 2
    inner = ndimage.binary_erosion(front, iterations=3)
    inner = inner if inner.any() else front
    i, k = np.unravel_index(int(np.argmax(np.where(inner, score, -np.inf))), score.shape)
    return np.array([m[i], p[i, k], s[k]])


def _skin_index(body: Bools) -> Floats:
    """Fractional posterior index (m, s) of the body's first surface from the front; the grid's end without one."""
    soft = ndimage.gaussian_filter(body.astype(np.float32), 1.0, truncate=3.0)
    first = np.argmax(soft > 0.5, axis=1)
    inside = np.take_along_axis(soft, first[:, None], axis=1)[:, 0]
    before = np.take_along_axis(soft, np.maximum(first - 1, 0)[:, None], axis=1)[:, 0]
    crossing = first - (inside - 0.5) / np.maximum(inside - before, 1e-3)
    return np.asarray(np.where(inside > 0.5, crossing, body.shape[1] - 1.0))


def _piece_at(front: Bools, volume: Volume, apex: Points) -> Bools:
    """The connected piece of a map (m, s) that holds the apex."""
    label, _ = ndimage.label(front)
    index = np.clip(np.rint(volume.to_index(apex)).astype(int), 0, np.array(volume.shape) - 1)
    return np.asarray(label == label[index[0], index[2]]) & front


def _at_skin(values: NDArray[Any], skin: Floats) -> Floats:
    """Samples (m, s) of a volume at fractional posterior indices (m, s)."""
    i, k = np.indices(skin.shape)
    return np.asarray(ndimage.map_coordinates(values, [i, skin, k], order=1, mode="nearest"), dtype=float)


def _bulge(body: Bools, spacing: NDArray[np.float64], skin: Floats) -> Floats:
    """Share of a ball of some 10 mm around each skin point that is air, less a half."""
    full = ndimage.gaussian_filter(body.astype(np.float32), 6.0 / spacing, mode="nearest", truncate=2.5)
    return 0.5 - _at_skin(full, skin)


def _below_skin(volume: Volume, depth: NDArray[np.float32], skin: Floats) -> Floats:
    """Mean intensity 2 to 8 mm below the skin near each skin point."""
    layer = ((depth > 2.0) & (depth < 8.0)).astype(np.float32)
    sigma = 3.0 / volume.spacing
    weight = ndimage.gaussian_filter(layer, sigma, truncate=2.5)
    mean = ndimage.gaussian_filter(volume.data * layer, sigma, truncate=2.5) / np.maximum(weight, 1e-2)
    return _at_skin(mean, skin + 5.0 / volume.spacing[1])


def _spot(values: Floats, front: Bools, spacing_mm: float) -> Floats:
    """How much each point stands out in every direction: least downward curvature at 5 mm, in SDs of the front."""
    entries = feature.hessian_matrix(values, sigma=5.0 / spacing_mm, mode="nearest", use_gaussian_derivatives=True)
    least = -feature.hessian_matrix_eigvals(entries)[0]
    return np.asarray(least / max(float(least[front].std()), 1e-12))
