"""The breast's mask in a canonical mammogram, without background, text and markers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Floats32
from mammoreg.errors import DataError

NOISE_SIGMAS = 6.0
_SMOOTHING_MM = 0.25
_LEAST_AREA_MM2 = 500.0
_GRID_MM = 0.5
_LINE_MM = 3.0  # thinner than this is a detector's column, a paddle's edge or a letter, and no breast


def smoothed(pixels: Floats32, pixel_mm: float) -> Floats32:
    """The image with its noise damped for edge finding (Gaussian of 0.25 mm)."""
    return np.asarray(ndimage.gaussian_filter(pixels, _SMOOTHING_MM / pixel_mm), dtype=np.float32)


def breast_mask(smooth: Floats32, level: float, pixel_mm: float) -> NDArray[np.bool_]:
    """Mask (rows, columns) of the largest connected region above a level, filled; text and markers are left out.

    Raises:
        DataError: If no region of at least 5 cm2 stands out, or it does not come near the chest-wall edge (column 0).
    """
    labels, count = ndimage.label(_without_lines(smooth > level, pixel_mm))
    sizes = np.bincount(labels.ravel(), minlength=2)[1:]
    if count == 0 or sizes.max() * pixel_mm**2 < _LEAST_AREA_MM2:
        raise DataError("no breast found in the mammogram: no region of 5 cm2 stands out from the air")
    mask = _filled(labels == 1 + int(np.argmax(sizes)))
    first = int(np.flatnonzero(mask.any(axis=0))[0])
    if first > 0.3 * mask.shape[1]:
        raise DataError("the breast in the mammogram does not reach the chest-wall edge; check orientation and crop")
    return mask


def _without_lines(mask: NDArray[np.bool_], pixel_mm: float) -> NDArray[np.bool_]:
    """The mask without what is thinner than a breast, found on a coarse grid for speed; the border is no end."""
    factor = max(1, int(_GRID_MM / pixel_mm + 1e-6))
    coarse = block_mean(mask.astype(np.float32), factor) > 0.5
    reach = 0.5 * _LINE_MM / (factor * pixel_mm)
    width = int(np.ceil(reach)) + 1
    core = ndimage.distance_transform_edt(np.pad(coarse, width, mode="edge")) > reach
    if not core.any():
        return mask
    opened = (ndimage.distance_transform_edt(~core) <= reach + 1.0)[width:-width, width:-width]
    return mask & enlarged(opened, factor, mask.shape)


def block_mean(image: Floats32, factor: int) -> Floats32:
    """Image reduced by a whole factor; the last row and column stand for what a whole block lacks."""
    if factor == 1:
        return image
    rows, columns = (-(-n // factor) * factor for n in image.shape)
    padded = np.pad(image, ((0, rows - image.shape[0]), (0, columns - image.shape[1])), mode="edge")
    blocks = padded.reshape(rows // factor, factor, columns // factor, factor)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)


def enlarged(mask: NDArray[np.bool_], factor: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """A mask of `block_mean`'s grid on the image of the shape that it was made of."""
    return np.repeat(np.repeat(mask, factor, axis=0), factor, axis=1)[: shape[0], : shape[1]]


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    # Holes may open to the chest-wall edge only: there the image is cut, so that side is closed first.
    closed = np.pad(mask, ((0, 0), (1, 0)), constant_values=False)
    rows = np.flatnonzero(mask[:, 0])
    if rows.size:
        closed[rows[0] : rows[-1] + 1, 0] = True
    filled: NDArray[Any] = ndimage.binary_fill_holes(closed)
    return np.asarray(filled[:, 1:], dtype=bool)
