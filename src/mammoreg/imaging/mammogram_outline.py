"""The breast's outline between skin and air, with sub-pixel accuracy, and how far each point can be trusted."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import measure

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import Air

# All chosen, from the blur and the pixels of a mammogram.
_STEP_MM = 1.0  # of the outline's points
_SAMPLING_MM = 0.25  # of the contour before it is smoothed
_WINDOW_MM = 5.0  # over which a cubic smooths it
_MARGIN_MM = 1.0  # about the mask's border, within which the edge is sought
_INSIDE_MM = 0.75  # how far in and out half of the brightness is sought
_REFINED_MM = 0.05  # in steps of
FADE_MM = 10.0  # over which trust fades before chest wall, border and muscle


def outline_polyline(
    smooth: Floats32, mask: NDArray[np.bool_], level: float, air: Air, pixel_mm: float
) -> NDArray[np.float64]:
    """Smooth polyline (M, 2) of (column, row) between skin and air, 1 mm apart, from its low-row to its high-row end.

    Raises:
        DataError: If the breast shows no edge against air.
    """
    contour = _longest_contour(_only_breast(smooth, mask, air, pixel_mm), level)
    contour = _open_at_chest_wall(contour, _MARGIN_MM / pixel_mm)
    contour = _at_half_height(_resampled(contour, _SAMPLING_MM / pixel_mm), smooth, mask, air, pixel_mm)
    contour = _smooth_polyline(contour, pixel_mm)
    return contour if contour[0, 1] <= contour[-1, 1] else contour[::-1].copy()


def outline_weight(
    outline: NDArray[np.float64],
    mask: NDArray[np.bool_],
    pectoral: NDArray[np.bool_] | None,
    pixel_mm: float,
) -> NDArray[np.float64]:
    """Weight (M,): 1 where the outline is skin, fading to 0 over the last 10 mm before chest wall, border, pectoral.

    Args:
        outline: (M, 2) of (column, row).
        mask: breast mask; its first column is where the breast's image begins.
        pectoral: mask of the pectoral muscle, or None.
    """
    rows, columns = mask.shape
    first = int(np.flatnonzero(mask.any(axis=0))[0])
    column, row = outline.T
    distance = np.minimum.reduce([column - first, columns - 1 - column, row, rows - 1 - row]) * pixel_mm
    if pectoral is not None:
        away = ndimage.distance_transform_edt(~pectoral, sampling=pixel_mm)
        distance = np.minimum(distance, ndimage.map_coordinates(away, [row, column], order=1, mode="nearest"))
    return np.asarray(np.clip(distance / FADE_MM, 0.0, 1.0), dtype=float)


def _only_breast(smooth: Floats32, mask: NDArray[np.bool_], air: Air, pixel_mm: float) -> Floats32:
    near = ndimage.distance_transform_edt(~mask) * pixel_mm <= _MARGIN_MM
    deep = ndimage.distance_transform_edt(mask) * pixel_mm > _MARGIN_MM
    image = np.where(near, smooth, np.float32(air.level))
    return np.asarray(np.where(deep, smooth.max(), image), dtype=np.float32)


def _longest_contour(image: Floats32, level: float) -> NDArray[np.float64]:
    contours = measure.find_contours(image, level)
    if not contours:
        raise DataError("the breast in the mammogram shows no edge against air; the image is cropped too tightly")
    longest = max(contours, key=len)
    return np.asarray(longest[:, ::-1], dtype=float)


def _open_at_chest_wall(contour: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    if np.any(contour[0] != contour[-1]):
        return contour
    ring = np.roll(contour[:-1], -int(np.argmin(contour[:-1, 0])), axis=0)
    return np.asarray(ring[ring[:, 0] > ring[:, 0].min() + margin], dtype=float)


def _at_half_height(
    contour: NDArray[np.float64], smooth: Floats32, mask: NDArray[np.bool_], air: Air, pixel_mm: float
) -> NDArray[np.float64]:
    """Move each point along its normal to half of the brightness that is reached just inside.

    The contour's level lies near the air's, which blur carries outwards by its own width.
    """
    tangent = np.gradient(_smoothed(contour, min(21, len(contour) // 2 * 2 - 1), 1), axis=0)
    outward = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-9)[:, None]
    steps = np.arange(-_INSIDE_MM, _INSIDE_MM, _REFINED_MM)
    places = contour[:, None, :] + (steps / pixel_mm)[None, :, None] * outward[:, None, :]
    if _sample(mask.astype(np.float32), places[:, 0]).mean() < _sample(mask.astype(np.float32), places[:, -1]).mean():
        places = places[:, ::-1]
    above = _sample(smooth, places) - air.level
    low = above < 0.5 * above[:, :1]
    first = np.where(low.any(axis=1), np.argmax(low, axis=1), len(steps) // 2)
    return np.asarray(places[np.arange(len(contour)), first], dtype=float)


def _sample(image: Floats32, places: NDArray[np.float64]) -> NDArray[np.float64]:
    values = ndimage.map_coordinates(image, [places[..., 1], places[..., 0]], order=1, mode="nearest")
    return np.asarray(values, dtype=float)


def _smooth_polyline(dense: NDArray[np.float64], pixel_mm: float) -> NDArray[np.float64]:
    window = round(_WINDOW_MM / _SAMPLING_MM) | 1
    if len(dense) <= window:
        raise DataError("the breast's edge against air in the mammogram is shorter than 5 mm; check the image")
    # A local cubic keeps the curvature that a Gaussian would flatten.
    return _resampled(_smoothed(dense, window, 3), _STEP_MM / pixel_mm)


def _resampled(polyline: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(2, round(length[-1] / step) + 1))
    return np.stack([np.interp(at, length, polyline[:, axis]) for axis in range(2)], axis=1)


def _smoothed(polyline: NDArray[np.float64], window: int, degree: int) -> NDArray[np.float64]:
    from scipy.signal import savgol_filter  # takes a second to import

    return np.asarray(savgol_filter(polyline, window, degree, axis=0))
