"""The grey level at which a mammogram's breast ends: where the outline has a step, however the air glows."""

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


def find_level(pixels: Floats32, smooth: Floats32, air: Air, pixel_mm: float) -> EdgeLevel:
    """The lowest level above the air whose contour has a step almost everywhere, else the one that has most of it.

    Air that glows beside the breast lies above the air at the border, and its contours have no step. Skin that fades
    into the air must be cut at its foot, for higher up there is none either.

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
    best, best_share, best_step, fault = floor, -1.0, 0.0, None
    for level in (floor, *(n for n in air.level + _LEVELS * scale.reach if n > floor)):
        try:
            share, step = _step_of(coarse, level, grid_mm, scale)
        except DataError as error:
            fault = fault or error
            continue
        # A contour just outside the step sees part of it.
        if best_share >= STEPPED_SHARE and (share < STEPPED_SHARE or step < _HIGHER * best_step):
            break
        if share > best_share or share >= STEPPED_SHARE:
            best, best_share, best_step = level, share, step
    if best_share < 0.0 and fault is not None:
        raise fault
    return EdgeLevel(best, scale)


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


def _step_of(image: Floats32, level: float, grid_mm: float, scale: GreyScale) -> tuple[float, float]:
    """Share of the free contour of a level along which the step stands, and its median height.

    Raises:
        DataError: no breast at this level, or too little of its contour is free.
    """
    contour, free = _contour(breast_mask(image, level, grid_mm), grid_mm)
    if free.sum() * grid_mm < _LEAST_FREE_MM:
        raise DataError("the breast in the mammogram shows no edge against air; the image is cropped too tightly")
    found = grey_step(image, contour, grid_mm, scale)
    return float(found.stands[free].mean()), float(np.median(found.height[free]))


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
