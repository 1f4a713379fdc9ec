"""The frame about a scanned film, or about an export: even bands at the border that are no air."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import find_air

# All chosen.
_EVEN_SHARE = 0.9  # of a line's pixels, which have one value; the rest are letters
_SAME_SHARE = 0.04  # of the image's range, within which values are one
_OTHER_SHARE = 0.25  # of the range, by which a frame differs from air
_WIDEST_SHARE = 0.15  # of the image that a band may take
_EVERY = 4  # pixels of a line that are looked at


@dataclass(frozen=True)
class _Band:
    lines: int
    value: float


def without_frame(stored: NDArray[Any]) -> Floats32:
    """The image (rows, columns), in any polarity, with the frame's bands turned into air; without one as it is."""
    image = np.asarray(stored, dtype=np.float32)
    if image.ndim != 2 or min(image.shape) < 64 or not np.isfinite(image).all():
        return image
    reach = float(np.ptp(np.percentile(image[::_EVERY, ::_EVERY], (0.5, 99.5))))
    bands = [_band(turned, reach) for turned in (image, image[::-1], image.T, image.T[::-1])]
    top, bottom, left, right = (band.lines for band in bands)
    inner = (slice(top, image.shape[0] - bottom), slice(left, image.shape[1] - right))
    if inner == (slice(0, image.shape[0]), slice(0, image.shape[1])):
        return image
    try:
        air = find_air(image[inner])
    except DataError:
        return image
    # A seam of mixed values lies where a scan's frame ends.
    seam = 2
    framed = image
    for band, side in zip(bands, _sides(image.shape, bands, seam), strict=True):
        if band.lines and abs(band.value - air.level) > _OTHER_SHARE * reach:
            framed = framed.copy() if framed is image else framed
            framed[side] = air.level
    return framed


def _band(image: Floats32, reach: float) -> _Band:
    """The first rows of an image that are even and of one value."""
    lines = image[: round(_WIDEST_SHARE * len(image)), ::_EVERY]
    value = float(np.median(lines[0]))
    even = (np.abs(lines - value) <= _SAME_SHARE * reach).mean(axis=1) >= _EVEN_SHARE
    return _Band(len(even) if even.all() else int(np.argmin(even)), value)


def _sides(shape: tuple[int, ...], bands: list[_Band], seam: int) -> tuple[tuple[slice, slice], ...]:
    whole = slice(None)
    top, bottom, left, right = (band.lines + seam for band in bands)
    return (
        (slice(0, top), whole),
        (slice(shape[0] - bottom, shape[0]), whole),
        (whole, slice(0, left)),
        (whole, slice(shape[1] - right, shape[1])),
    )
