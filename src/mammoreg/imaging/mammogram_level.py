"""The grey level at which a mammogram's breast ends: where the outline has a step, however the air glows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import measure

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import Air
from mammoreg.imaging.mammogram_breast import NOISE_SIGMAS, block_mean, breast_mask, smoothed
from mammoreg.imaging.mammogram_polyline import resampled
from mammoreg.imaging.mammogram_step import GreyScale, grey_scale, grey_step

# All chosen.
STEPPED_SHARE = 0.97  # of the free outline, along which a level's step must stand
_HIGHER = 1.3  # step of the next level's contour that shows that the first one lies outside of it
_FAR_HIGHER = 3.0  # step of a contour well within the first one that shows that the first one is not the breast's
_WITHIN_SHARE = 0.8  # of its area
LEAST_STEPPED_SHARE = 0.6  # with less of it there is no outline
_GRID_MM = 0.5  # of the image on which levels are tried
_LEVELS = np.geomspace(0.002, 0.5, 20)  # shares of the range above air that are tried
_BORDER_MM = 5.0  # from the image's border, where an outline is not free
_SMOOTH_MM = 1.5  # of the contour whose normals are used
_LEAST_FREE_MM = 30.0


@dataclass(frozen=True)
class EdgeLevel:
    """Where the breast ends.

    Attributes:
        level: grey value between skin and air.
        scale: what grey values mean in the image.
    """

    level: float
    scale: GreyScale


@dataclass(frozen=True)
class _Contour:
    """A level's contour: share of it along which a step stands, the step's median height, the area within."""

    level: float
    share: float
    step: float
    area: int


def find_level(pixels: Floats32, smooth: Floats32, air: Air, pixel_mm: float) -> EdgeLevel:
    """The lowest level above the air whose contour has a step almost everywhere, else the one that has most of it.

    Air that glows beside the breast lies above the air at the border, and its contours have no step. Skin that fades
    into the air must be cut at its foot, for higher up there is none either. A paddle's edge has a step too, but a
    greater one, the breast's, lies well within.

    Args:
        pixels: canonical image.
        smooth: the same with its noise damped.

    Raises:
        DataError: no breast stands out at any level.
    """
    scale = _scale_of(pixels, smooth, air)
    factor = max(1, round(_GRID_MM / pixel_mm))
    coarse, grid_mm = smoothed(block_mean(smooth, factor), factor * pixel_mm), factor * pixel_mm
    floor = air.level + max(0.5 * scale.least_step, NOISE_SIGMAS * air.noise)
    tried, faults = [], []
    for level in (floor, *(n for n in air.level + _LEVELS * scale.reach if n > floor)):
        try:
            tried.append(_contour_at(coarse, level, grid_mm, scale))
        except DataError as error:
            faults.append(error)
    if not tried:
        raise faults[0]
    return EdgeLevel(_chosen(tried).level, scale)


def _chosen(tried: Sequence[_Contour]) -> _Contour:
    """Of contours of rising level the one that is the breast's."""
    stepped = [contour for contour in tried if contour.share >= STEPPED_SHARE]
    if not stepped:
        return max(tried, key=lambda contour: contour.share)
    best = stepped[0]
    for contour in stepped[1:]:
        # A contour just outside the step sees part of it; that of a paddle or of a plateau of glow is another's.
        next_level = tried.index(contour) == tried.index(best) + 1
        within = contour.area < _WITHIN_SHARE * best.area and contour.step >= _FAR_HIGHER * best.step
        if within or (next_level and contour.step >= _HIGHER * best.step):
            best = contour
    return best


def _scale_of(pixels: Floats32, smooth: Floats32, air: Air) -> GreyScale:
    from skimage.filters import threshold_otsu  # takes a second to import

    # A metal clip or a label brighter than tissue must not set the range.
    shown = np.minimum(smooth, np.percentile(smooth, 99.0))
    threshold = float(threshold_otsu(shown))
    width = max(2, round(0.02 * smooth.shape[1]))
    strip = smooth[:, :width] if air.side == "left" else smooth[:, -width:]
    rough = strip - ndimage.gaussian_filter(strip, 4.0)
    noise = 1.4826 * float(np.median(np.abs(rough)))
    return grey_scale(pixels, smooth, air.level, threshold, noise)


def _contour_at(image: Floats32, level: float, grid_mm: float, scale: GreyScale) -> _Contour:
    """The step across the free contour of a level.

    Raises:
        DataError: no breast at this level, or too little of its contour is free.
    """
    mask = breast_mask(image, level, grid_mm)
    contour, free = _contour(mask, grid_mm)
    if free.sum() * grid_mm < _LEAST_FREE_MM:
        raise DataError("the breast in the mammogram shows no edge against air; the image is cropped too tightly")
    found = grey_step(image, contour, grid_mm, scale)
    stands, height = float(found.stands[free].mean()), float(np.median(found.height[free]))
    return _Contour(level, stands, height, int(mask.sum()))


def _contour(mask: NDArray[np.bool_], grid_mm: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Closed contour (N, 2) of (column, row), turned as `outward_normals` wants it, and what of it is free."""
    padded = np.pad(mask.astype(np.float32), 1)
    contour = resampled(max(measure.find_contours(padded, 0.5), key=len)[:, ::-1] - 1.0, 1.0)
    following = np.roll(contour, -1, axis=0)
    if np.sum(contour[:, 0] * following[:, 1] - following[:, 0] * contour[:, 1]) < 0.0:
        contour = contour[::-1]
    contour = ndimage.gaussian_filter1d(contour, _SMOOTH_MM / grid_mm, axis=0, mode="wrap")
    rows, columns = mask.shape
    column, row = contour.T
    away = np.minimum.reduce([column, columns - 1 - column, row, rows - 1 - row]) * grid_mm
    return contour, away > _BORDER_MM
