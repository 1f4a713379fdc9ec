"""Air at the border of a mammogram: its level, its side, and what it says about polarity."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError

Side = Literal["left", "right"]

_STRIP_SHARE = 0.02
_FLAT_SHARE = 0.05
_UNEVEN_SHARE = 0.3
_DIFFERENT_SHARE = 0.1
_LEAST_BREAST_SHARE = 0.03


@dataclass(frozen=True)
class Air:
    """The air of an image.

    Attributes:
        level: its grey value (median).
        noise: its robust standard deviation.
        side: image edge, left or right, that shows it.
        bright: whether the breast is darker than air.
    """

    level: float
    noise: float
    side: Side
    bright: bool


def find_air(pixels: NDArray[Any]) -> Air:
    """Find the air along the left or the right edge of an image (rows, columns), in any polarity.

    The edge with the smaller spread of grey values is the nipple's side: it shows little but air.

    Raises:
        DataError: If the image is not finite, or shows no breast (nothing stands out from the air), or no air.
    """
    image = np.asarray(pixels, dtype=np.float32)
    if image.ndim != 2 or min(image.shape) < 16:
        raise DataError(f"the mammogram has shape {image.shape}; an image of at least 16 x 16 pixels is needed")
    if not np.isfinite(image).all():
        raise DataError("the mammogram holds values that are not finite; export the image again")
    strips = _border_strips(image)
    side = _air_side(image, strips)
    level = float(np.median(strips[side]))
    noise = 1.4826 * float(np.median(np.abs(strips[side] - level)))
    bright = _breast_is_darker(image, level, noise)
    _refuse_covered(image, strips[side])
    return Air(level, noise, side, bright)


def _refuse_covered(image: Floats32, strip: Floats32) -> None:
    """Refuse a strip that is no air over a tenth of its length: level and polarity would be the breast's.

    Raises:
        DataError: with the remedy.
    """
    uneven = float(np.ptp(np.percentile(strip, (10, 90))))
    if uneven > _UNEVEN_SHARE * float(np.ptp(np.percentile(image, (1, 99)))):
        raise DataError(
            "neither the left nor the right edge of the mammogram shows air: the breast is cut at its anterior edge, "
            "or something covers it; give an image that shows the breast's front, or exclude the view"
        )


def _border_strips(image: Floats32) -> dict[Side, Floats32]:
    width = max(2, round(_STRIP_SHARE * image.shape[1]))
    return {"left": image[:, :width], "right": image[:, -width:]}


def _air_side(image: Floats32, strips: dict[Side, Floats32]) -> Side:
    left, right = (float(np.ptp(np.percentile(strips[side], (10, 90)))) for side in ("left", "right"))
    if max(left, right) > _FLAT_SHARE * float(np.ptp(np.percentile(image, (1, 99)))):
        return "left" if left < right else "right"
    # A blank margin at the chest wall looks like air too: then the breast's mass decides.
    difference = np.abs(image - np.median(np.concatenate(list(strips.values()), axis=1))).sum(axis=0)
    middle = image.shape[1] // 2
    return "left" if difference[:middle].sum() < difference[-middle:].sum() else "right"


def _breast_is_darker(image: Floats32, level: float, noise: float) -> bool:
    difference = image[::4, ::4] - level
    reach = float(np.percentile(np.abs(difference), 99))
    seen = np.abs(difference) > max(_DIFFERENT_SHARE * reach, 5.0 * noise)
    if reach <= 0.0 or seen.mean() < _LEAST_BREAST_SHARE:
        raise DataError("no breast found in the mammogram: nothing stands out from the air; check the image file")
    return bool(np.median(difference[seen]) < 0.0)
