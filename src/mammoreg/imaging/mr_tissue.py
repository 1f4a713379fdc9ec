"""Skin, fat and gland of the breast from a bias-corrected MR volume."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.filters import threshold_otsu

from mammoreg.arrays import Bools
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.labels import Label

SKIN_MM = 1.5
"""Thickness of the skin label: breast skin measures 1.5 mm on average (Huang et al., Med Phys 2008)."""
BLUR_MM = 3.0
"""Down to this depth the skin's signal, blurred by the voxels, would pass for gland."""
OUTLIER_SPANS = 4.0
"""Intensities further from the median than this many spans (median to 5th percentile of fat's side) are cut to it."""


def depth_below_skin(body: Bools, spacing: NDArray[np.float64]) -> NDArray[np.float32]:
    """Distance in mm of each body voxel's centre from the air's border; the grid's faces are no border."""
    distance = ndimage.distance_transform_edt(np.pad(body, 1, mode="edge"), sampling=spacing)[1:-1, 1:-1, 1:-1]
    return np.asarray(np.maximum(distance - 0.5 * spacing[0], 0.0) * body, dtype=np.float32)


def is_fat_suppressed(intensity: NDArray[np.float32], depth: NDArray[np.float32], breast: Bools) -> bool:
    """Tell from the image whether fat is dark.

    In units of the contrast between the two classes of the interior (0 the dark, 1 the bright one): with suppression
    the skin, which lies in the outer 4 mm, outshines the bright class, and the layer beneath, nearly always fat, is
    dark; without it nothing outshines fat.

    Raises:
        DataError: the breast has no interior.
    """
    layers = [
        intensity[breast & (depth > low) & (depth < high)] for low, high in ((0.3, 4.0), (3.5, 6.0), (5.0, np.inf))
    ]
    if min(layer.size for layer in layers) == 0:
        raise DataError("the breast is too small to tell skin from fat: check side and field of view")
    outer, beneath, interior = layers
    samples = np.clip(interior, *np.percentile(interior, [2.0, 98.0]))
    threshold = threshold_otsu(samples)
    dark, bright = samples[samples <= threshold].mean(), samples[samples > threshold].mean()
    skin, fat = (np.array([np.percentile(outer, 90.0), np.median(beneath)]) - dark) / max(bright - dark, 1e-9)
    return bool(skin - 2.0 * fat > 0.4)


def gland_threshold(samples: NDArray[np.float32], fat_suppressed: bool) -> float:
    """Intensity between fat and gland: Otsu's, with outliers on gland's side (vessels, failed fat suppression) cut.

    Raises:
        DataError: no samples.
    """
    if samples.size == 0:
        raise DataError("the breast is too small to tell gland from fat: check side and field of view")
    sign = 1.0 if fat_suppressed else -1.0
    signed = sign * samples
    median, low = np.percentile(signed, [50.0, 5.0])
    return float(sign * threshold_otsu(np.clip(signed, low, median + OUTLIER_SPANS * (median - low))))


def label_tissues(
    volume: Volume, body: Bools, breast: Bools, depth: NDArray[np.float32], fat_suppressed: bool
) -> NDArray[np.uint8]:
    """Label map: fat, gland and skin in the breast; all of the body behind it counts as muscle/chest wall.

    Gland is the bright class below the skin in a fat-suppressed volume and the dark one otherwise.
    """
    inner = breast & (depth > SKIN_MM)
    deep = breast & (depth > BLUR_MM)
    gland = deep & ((volume.data > gland_threshold(volume.data[deep], fat_suppressed)) == fat_suppressed)
    labels = np.zeros(body.shape, np.uint8)
    labels[body] = Label.MUSCLE
    labels[breast] = Label.SKIN
    labels[inner] = Label.FAT
    labels[gland] = Label.GLAND
    return labels
