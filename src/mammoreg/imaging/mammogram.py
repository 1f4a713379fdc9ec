"""Analysis of a canonical mammogram: breast, outline, pectoral muscle and nipple."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.imaging.mammogram_air import find_air
from mammoreg.imaging.mammogram_breast import breast_mask, edge_level, smoothed
from mammoreg.imaging.mammogram_nipple import nipple_in_outline
from mammoreg.imaging.mammogram_outline import outline_polyline, outline_weight
from mammoreg.imaging.mammogram_pectoral import pectoral_mask
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
    """

    mask: NDArray[np.bool_]
    outline: NDArray[np.float64]
    outline_weight: NDArray[np.float64]
    pectoral: NDArray[np.bool_] | None
    nipple: NDArray[np.float64] | None


def analyse(pixels: NDArray[Any], pixel_mm: float, view: View) -> MammogramAnalysis:
    """Find breast, outline, pectoral muscle (oblique and lateral views) and nipple in a canonical mammogram.

    Args:
        pixels: canonical image (rows, columns), bright = dense (`canonicalise`).
        pixel_mm: pixel spacing at the detector in mm.

    Raises:
        DataError: If no breast is found, it lies away from the chest wall, or it has no edge against air.
    """
    factor = max(1, int(_WORKING_PIXEL_MM / pixel_mm + 1e-6))
    image = _reduced(np.asarray(pixels, dtype=np.float32), factor)
    spacing = pixel_mm * factor
    air = find_air(image)
    smooth = smoothed(image, spacing)
    level = edge_level(smooth, air)
    mask = breast_mask(smooth, level, spacing)
    outline = outline_polyline(smooth, mask, level, air, spacing)
    pectoral = _pectoral(image, mask, spacing, view)
    weight = outline_weight(outline, mask, pectoral, spacing)
    nipple = nipple_in_outline(outline, weight, spacing)
    return MammogramAnalysis(
        mask=_enlarged(mask, factor, pixels.shape),
        outline=_to_full(outline, factor),
        outline_weight=weight,
        pectoral=None if pectoral is None else _enlarged(pectoral, factor, pixels.shape),
        nipple=None if nipple is None else _to_full(nipple, factor),
    )


def _pectoral(image: Floats32, mask: NDArray[np.bool_], spacing: float, view: View) -> NDArray[np.bool_] | None:
    """The muscle in a view that may show it; it is sought in the first rows, which are superior then."""
    if not PROJECTIONS[view].shows_pectoral:
        return None
    order = slice(None, None, 1 if PROJECTIONS[view].hung_as_canonical else -1)
    found = pectoral_mask(image[order], mask[order], spacing)
    return None if found is None else np.ascontiguousarray(found[order])


def _reduced(image: Floats32, factor: int) -> Floats32:
    if factor == 1:
        return image
    rows, columns = (-(-n // factor) * factor for n in image.shape)
    padded = np.pad(image, ((0, rows - image.shape[0]), (0, columns - image.shape[1])), mode="edge")
    blocks = padded.reshape(rows // factor, factor, columns // factor, factor)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)


def _enlarged(mask: NDArray[np.bool_], factor: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    return np.repeat(np.repeat(mask, factor, axis=0), factor, axis=1)[: shape[0], : shape[1]]


def _to_full(positions: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    return (positions + 0.5) * factor - 0.5
