"""The breast's outline between skin and air, with sub-pixel accuracy, and how far each point can be trusted."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy import ndimage
from skimage import measure

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import Air
from mammoreg.imaging.mammogram_polyline import across, grey_values, outward_normals, resampled

# All chosen, from the blur and the pixels of a mammogram.
_STEP_MM = 1.0  # of the outline's points
_SAMPLING_MM = 0.25  # of the contour before it is smoothed
_WINDOW_MM = 5.0  # over which a cubic smooths it
_MARGIN_MM = 1.0  # about the mask's border, within which the edge is sought
_INSIDE_MM = 0.75  # how far in and out half of the brightness is sought
_FOOT_SHARE = 0.035  # of the range, at which an edge is met before half of its brightness is sought
_REFINED_MM = 0.05  # in steps of
FADE_MM = 10.0  # over which trust fades before chest wall, border and muscle


def outline_polyline(
    smooth: Floats32, mask: NDArray[np.bool_], level: float, reach: float, air: Air, pixel_mm: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Smooth polyline (M, 2) of (column, row) between skin and air, 1 mm apart, from its low-row to its high-row end.

    It comes with the mask of the breast, cut where the skin's brightness begins to rise.

    Args:
        smooth: canonical image with its noise damped.
        mask: of the breast, at the level at which it ends.
        reach: range of grey values from air to dense tissue.

    Raises:
        DataError: If the breast shows no edge against air.
    """
    contour = _longest_contour(_only_breast(smooth, mask, level, air, pixel_mm), level)
    contour = _open_at_chest_wall(contour, _MARGIN_MM / pixel_mm)
    contour = contour if contour[0, 1] <= contour[-1, 1] else contour[::-1].copy()
    contour = resampled(contour, _SAMPLING_MM / pixel_mm)
    foot = _at_half_height(contour, smooth, air, pixel_mm, _FOOT_SHARE * reach)
    outline = _smooth_polyline(_at_half_height(foot, smooth, air, pixel_mm), pixel_mm)
    return outline, _inside(foot, mask)


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


def _inside(outline: NDArray[np.float64], mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    rows, columns = mask.shape
    picture = Image.new("1", (columns, rows))
    corners = [(-1.0, outline[0, 1]), *map(tuple, outline), (-1.0, outline[-1, 1])]
    ImageDraw.Draw(picture).polygon(corners, fill=1)
    return np.asarray(picture, dtype=bool) & mask


def _only_breast(smooth: Floats32, mask: NDArray[np.bool_], level: float, air: Air, pixel_mm: float) -> Floats32:
    width = 2 * max(1, round(_MARGIN_MM / pixel_mm)) + 1
    near = ndimage.maximum_filter(mask, width)
    deep = ndimage.minimum_filter(mask, width)
    # What is bright beside the breast is a line or a letter that was left out.
    image = np.where(near & (mask | (smooth < level)), smooth, np.float32(air.level))
    image = np.where(deep, smooth.max(), image)
    # A breast that the anterior edge cuts has one outline, along that edge, not two.
    return np.asarray(np.pad(image, ((0, 0), (0, 2)), constant_values=air.level), dtype=np.float32)


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
    contour: NDArray[np.float64], smooth: Floats32, air: Air, pixel_mm: float, most: float = np.inf
) -> NDArray[np.float64]:
    """Move each point along its normal to half of the brightness that is reached just inside, or to `most` if less.

    Blur carries a level near the air's outwards by its own width. Air that glows counts as bright as it is just
    outside.
    """
    even = _smoothed(contour, min(21, len(contour) // 2 * 2 - 1), 1)
    steps = np.arange(-_INSIDE_MM, _INSIDE_MM, _REFINED_MM)
    places = across(contour, outward_normals(even), steps / pixel_mm)
    grey = grey_values(smooth, places)
    above = grey - np.maximum(grey[:, -1:], air.level)
    low = above < np.minimum(0.5 * above[:, :1], most)
    first = np.where(low.any(axis=1), np.argmax(low, axis=1), len(steps) // 2)
    return np.asarray(places[np.arange(len(contour)), first], dtype=float)


def _smooth_polyline(dense: NDArray[np.float64], pixel_mm: float) -> NDArray[np.float64]:
    window = round(_WINDOW_MM / _SAMPLING_MM) | 1
    if len(dense) <= window:
        raise DataError("the breast's edge against air in the mammogram is shorter than 5 mm; check the image")
    # A local cubic keeps the curvature that a Gaussian would flatten.
    return resampled(_smoothed(dense, window, 3), _STEP_MM / pixel_mm)


def _smoothed(polyline: NDArray[np.float64], window: int, degree: int) -> NDArray[np.float64]:
    from scipy.signal import savgol_filter  # takes a second to import

    return np.asarray(savgol_filter(polyline, window, degree, axis=0))
