"""Analysis of a canonical mammogram: breast, outline, pectoral muscle and nipple."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import find_air
from mammoreg.imaging.mammogram_breast import block_mean, breast_mask, enlarged, smoothed
from mammoreg.imaging.mammogram_level import LEAST_STEPPED_SHARE, EdgeLevel, find_level
from mammoreg.imaging.mammogram_nipple import nipple_in_outline
from mammoreg.imaging.mammogram_outline import outline_polyline, outline_weight
from mammoreg.imaging.mammogram_pectoral import pectoral_mask
from mammoreg.imaging.mammogram_step import LEAST_STEP_SHARE, grey_step
from mammoreg.imaging.views import PROJECTIONS, View

_WORKING_PIXEL_MM = 0.2


@dataclass(frozen=True)
class MammogramAnalysis:
    """What a mammogram shows, in pixels of the canonical image.

    Attributes:
        mask: breast, pectoral muscle included, (rows, columns).
        outline: polyline (M, 2) of (column, row) between skin and air, from its low-row to its high-row end.
        outline_weight: (M,) 1 where the outline is skin, 0 at chest wall, image border and pectoral muscle.
        pectoral: mask of the pectoral muscle, or None.
        nipple: (2,) of (column, row), or None where it is not seen in profile.
        step: median grey step across the outline where it is skin, as a share of the breast's range of grey values.
        stepped_share: share of that outline along which the step stands out from noise and slopes.
        cut_mm: length over which the image's anterior edge cuts the breast.
        muscle_below: whether a pectoral muscle shows in the inferior corner alone: the rows may run the other way.
    """

    mask: NDArray[np.bool_]
    outline: NDArray[np.float64]
    outline_weight: NDArray[np.float64]
    pectoral: NDArray[np.bool_] | None
    nipple: NDArray[np.float64] | None
    step: float
    stepped_share: float
    cut_mm: float
    muscle_below: bool = False


def analyse(pixels: NDArray[Any], pixel_mm: float, view: View) -> MammogramAnalysis:
    """Find breast, outline, pectoral muscle (oblique and lateral views) and nipple in a canonical mammogram.

    Args:
        pixels: canonical image (rows, columns), bright = dense (`canonicalise`).
        pixel_mm: pixel spacing at the detector in mm.

    Raises:
        DataError: If no breast is found, it lies away from the chest wall, or it has no edge against air.
    """
    factor = max(1, int(_WORKING_PIXEL_MM / pixel_mm + 1e-6))
    image = block_mean(np.asarray(pixels, dtype=np.float32), factor)
    spacing = pixel_mm * factor
    air = find_air(image)
    smooth = smoothed(image, spacing)
    edge = find_level(image, smooth, air, spacing)
    mask = breast_mask(smooth, edge.level, spacing)
    cut_mm = float(mask[:, -2:].any(axis=1).sum()) * spacing
    outline, mask = outline_polyline(smooth, mask, edge.level, edge.scale.reach, air, spacing)
    pectoral = _pectoral(image, mask, spacing, view)
    weight = outline_weight(outline, mask, pectoral, spacing)
    nipple = nipple_in_outline(outline, weight, spacing)
    step, stepped = _checked_step(smooth, outline, weight, edge, spacing)
    return MammogramAnalysis(
        mask=enlarged(mask, factor, pixels.shape),
        outline=_to_full(outline, factor),
        outline_weight=weight,
        pectoral=None if pectoral is None else enlarged(pectoral, factor, pixels.shape),
        nipple=None if nipple is None else _to_full(nipple, factor),
        step=step,
        stepped_share=stepped,
        cut_mm=cut_mm,
        muscle_below=pectoral is None and _pectoral(image[::-1], mask[::-1], spacing, view) is not None,
    )


def _pectoral(image: Floats32, mask: NDArray[np.bool_], spacing: float, view: View) -> NDArray[np.bool_] | None:
    """The muscle in a view that may show it; it is sought in the first rows, which are superior then."""
    if not PROJECTIONS[view].shows_pectoral:
        return None
    order = slice(None, None, 1 if PROJECTIONS[view].hung_as_canonical else -1)
    found = pectoral_mask(image[order], mask[order], spacing)
    return None if found is None else np.ascontiguousarray(found[order])


def _checked_step(
    smooth: Floats32, outline: NDArray[np.float64], weight: NDArray[np.float64], edge: EdgeLevel, pixel_mm: float
) -> tuple[float, float]:
    """Median step along the outline where it is skin, and the share of it that has one.

    Raises:
        DataError: nothing of the outline is skin, or there is no step.
    """
    skin = weight > 0.5
    if not skin.any():
        raise DataError("the breast fills the mammogram: no part of its outline is skin; give an image that shows it")
    found = grey_step(smooth, outline, pixel_mm, edge.scale)
    step, stepped = float(np.median(found.height[skin])), float(found.stands[skin].mean())
    if step < LEAST_STEP_SHARE or stepped < LEAST_STEPPED_SHARE:
        raise DataError(
            f"no outline found in the mammogram: along {1.0 - stepped:.0%} of it there is no grey step between breast "
            f"and air (median {step:.3f} of the range); export the image with its whole range of grey values, without "
            "windowing, or exclude the view"
        )
    return step, stepped


def _to_full(positions: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    return (positions + 0.5) * factor - 0.5
