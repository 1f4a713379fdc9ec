"""The breast's mask in a canonical mammogram, without background, text and markers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError
from mammoreg.imaging.mammogram_air import Air

_EDGE_SHARE = 0.035
_NOISE_SIGMAS = 6.0
_SMOOTHING_MM = 0.25
_LEAST_AREA_MM2 = 500.0


def smoothed(pixels: Floats32, pixel_mm: float) -> Floats32:
    """The image with its noise damped for edge finding (Gaussian of 0.25 mm)."""
    return np.asarray(ndimage.gaussian_filter(pixels, _SMOOTHING_MM / pixel_mm), dtype=np.float32)


def edge_level(pixels: Floats32, air: Air) -> float:
    """Grey value that separates skin from air: just above the air's noise, a few percent of the tissue's range."""
    tissue = pixels[pixels > air.level + _NOISE_SIGMAS * air.noise]
    reach = float(np.percentile(tissue, 90)) - air.level if tissue.size else 0.0
    return air.level + max(_EDGE_SHARE * reach, _NOISE_SIGMAS * air.noise)


def breast_mask(smooth: Floats32, level: float, pixel_mm: float) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the largest connected region above a level, filled; text and markers are left out.

    Raises:
        DataError: If no region of at least 5 cm2 stands out, or it does not come near the chest-wall edge (column 0).
    """
    labels, count = ndimage.label(smooth > level)
    sizes = np.bincount(labels.ravel(), minlength=2)[1:]
    if count == 0 or sizes.max() * pixel_mm**2 < _LEAST_AREA_MM2:
        raise DataError("no breast found in the mammogram: no region of 5 cm2 stands out from the air")
    mask = _filled(labels == 1 + int(np.argmax(sizes)))
    first = int(np.flatnonzero(mask.any(axis=0))[0])
    if first > 0.3 * mask.shape[1]:
        raise DataError("the breast in the mammogram does not reach the chest-wall edge; check orientation and crop")
    return mask


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    # Holes may open to the chest-wall edge only: there the image is cut, so that side is closed first.
    closed = np.pad(mask, ((0, 0), (1, 0)), constant_values=False)
    rows = np.flatnonzero(mask[:, 0])
    if rows.size:
        closed[rows[0] : rows[-1] + 1, 0] = True
    filled: NDArray[Any] = ndimage.binary_fill_holes(closed)
    return np.asarray(filled[:, 1:], dtype=bool)
