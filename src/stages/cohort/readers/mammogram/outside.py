"""What a mammogram's pixels show beside the detector's field: padding, shutters, collimators. They are made air."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset

from mammoreg.arrays import Bools, Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import find_air
from stages.cohort.readers.header_values import number, text, texts

_LEAST_FIELD_SHARE = 0.25  # chosen: a field declared smaller than this does not belong to this image
_DARK_SHARE = 0.02  # of the air's exposure: behind a collimator there is less, through a breast rarely
_LIT_SHARE = 0.3  # of the first line of the field that must be lit: air beside the breast
_LARGEST_BAND_SHARE = 0.25


def with_air_outside(pixels: Floats32, header: Dataset, linear: bool) -> Floats32:
    """A mammogram whose pixels outside the detector's field have the air's grey value.

    Args:
        pixels: (rows, columns) as stored.
        linear: whether they are proportional to exposure; then an undeclared dark border is found too.
    """
    outside = _padding(pixels, header) | _behind_edges(pixels.shape, header)
    if linear:
        outside |= _unexposed_border(pixels, outside)
    if not outside.any() or outside.all():
        return pixels
    level = _air_level(pixels, outside, _air_is_bright(header))
    return np.where(outside, np.float32(level), pixels)


def _padding(pixels: Floats32, header: Dataset) -> Bools:
    limits = [_stored_value(header, key) for key in ("PixelPaddingValue", "PixelPaddingRangeLimit")]
    known = [limit for limit in limits if limit is not None]
    if limits[0] is None:
        return np.zeros(pixels.shape, dtype=bool)
    return (pixels >= min(known)) & (pixels <= max(known))


def _stored_value(header: Dataset, keyword: str) -> float | None:
    """A grey value of the header; of signed pixels also where it was written unsigned."""
    written = texts(header, keyword)
    found = number(written[0]) if written else None
    if found is None:
        return None
    signed, bits = text(header, "PixelRepresentation") == "1", number(text(header, "BitsAllocated") or "16")
    size = 2.0 ** (16.0 if bits is None else bits.value)
    return found.value - size if signed and found.value >= 0.5 * size else found.value


def _behind_edges(shape: tuple[int, ...], header: Dataset) -> Bools:
    """What lies behind a rectangular shutter or collimator."""
    outside = np.zeros(shape, dtype=bool)
    for kind in ("Shutter", "Collimator"):
        if "RECTANGULAR" not in (text(header, f"{kind}Shape") or ""):
            continue
        names = ("UpperHorizontalEdge", "LowerHorizontalEdge", "LeftVerticalEdge", "RightVerticalEdge")
        edges = [number(text(header, f"{kind}{name}") or "") for name in names]
        top, bottom, left, right = (None if edge is None else int(edge.value) for edge in edges)
        if top is None or bottom is None or left is None or right is None:
            continue
        field = np.zeros(shape, dtype=bool)
        field[max(top - 1, 0) : max(bottom, 0), max(left - 1, 0) : max(right, 0)] = True
        if field.mean() >= _LEAST_FIELD_SHARE:
            outside |= ~field
    return outside


def _unexposed_border(pixels: Floats32, outside: Bools) -> Bools:
    """Dark bands along the image's borders that end at once where air is lit: a collimator, not a breast."""
    found = np.zeros(pixels.shape, dtype=bool)
    dark = pixels < _DARK_SHARE * float(np.percentile(pixels[~outside] if not outside.all() else pixels, 99.0))
    for turn in range(4):
        width = _band(np.rot90(dark | outside, turn))
        np.rot90(found, turn)[:width] = True
    return found


def _band(dark: Bools) -> int:
    """Rows at the top of an image that are dark all along and followed by a row that is lit along a good part."""
    whole = dark.mean(axis=1) > 0.99
    width = int(np.argmin(whole)) if not whole.all() else 0
    if not 0 < width <= _LARGEST_BAND_SHARE * len(dark):
        return 0
    after = dark[min(width + 2, len(dark) - 1)]
    return width if 1.0 - after.mean() >= _LIT_SHARE else 0


def _air_is_bright(header: Dataset) -> bool:
    """What the header says of the air's grey value: high where pixels grow with exposure, else by the display."""
    sign = number(text(header, "PixelIntensityRelationshipSign") or "")
    if text(header, "PresentationIntentType") == "FOR PROCESSING" and sign is not None and sign.value != 0.0:
        return sign.value > 0.0
    return text(header, "PhotometricInterpretation") == "MONOCHROME1"


def _air_level(pixels: Floats32, outside: Bools, bright: bool) -> float:
    """The air's grey value, as the field shows it; where the whole air is outside the field, its extreme value."""
    inside = pixels[~outside]
    extreme: dict[bool, Callable[[NDArray[np.float32]], np.float32]] = {True: np.max, False: np.min}
    for guess in (bright, not bright):
        filled = np.where(outside, extreme[guess](inside), pixels)
        rows, columns = (np.flatnonzero((~outside).any(axis=axis)) for axis in (1, 0))
        try:
            air = find_air(filled[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1])
        except DataError:
            continue
        if air.bright == guess:
            return air.level
    return float(extreme[bright](inside))
