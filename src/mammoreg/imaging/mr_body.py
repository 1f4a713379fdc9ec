"""The patient's body against air in an MR volume of the breast frame."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.filters import threshold_otsu

from mammoreg.arrays import Bools
from mammoreg.errors import DataError
from mammoreg.geometry import Volume

GHOST_SHARE = 0.3
"""Share of the surrounding tissue's intensity below which a bright place beside the body is a ghost."""


def air_threshold(samples: NDArray[np.float32]) -> tuple[float, float]:
    """Level between air and tissue, and the mean level of air.

    Otsu's threshold of the logarithms: coil inhomogeneity and fat suppression spread tissue over a decade.

    Raises:
        DataError: the samples hold one level only.
    """
    scale = float(np.percentile(samples, 99.0))
    if not np.isfinite(scale) or scale <= float(samples.min()):
        raise DataError("the MR volume is constant or almost empty: hand in the volume of intensities")
    logs = np.log(np.clip(samples, 0.04 * scale, None))
    threshold = float(np.exp(threshold_otsu(logs)))
    return threshold, float(samples[samples < threshold].mean())


def outside_air(dark: Bools) -> Bools:
    """Dark voxels reached from the anterior face of the grid (posterior index 0): air, and neither lung nor vessel.

    Passages narrower than six voxels are closed, so that noise in the chest wall does not open the lungs.
    """
    padded = np.pad(dark, ((3, 3), (3, 0), (3, 3)), mode="edge")
    wide = ndimage.binary_erosion(padded, iterations=3, border_value=1)
    label, _ = ndimage.label(wide)
    front = np.unique(label[:, 0])
    reached = np.isin(label, front[front > 0])
    air = ndimage.binary_dilation(reached, iterations=4, mask=padded)
    return np.asarray(air[3:-3, 3:, 3:-3], dtype=np.bool_)


def body_mask(volume: Volume) -> Bools:
    """Body against air, to about half a voxel: skin closed, lungs and other dark holes filled.

    A global threshold finds the body; then the level half-way between air and the tissue nearby (within some 4 mm) sets
    its border, so that bright and dark skin are cut at the same place. What is much darker than the tissue of the
    surroundings is a ghost.

    Raises:
        DataError: no body in the volume.
    """
    smooth = ndimage.gaussian_filter(volume.data, 0.5, truncate=3.0)
    threshold, air = air_threshold(smooth[::2, ::2, ::2])
    rough = _solid(smooth > threshold)
    nearby = _local_mean(smooth, rough, 4.0 / volume.spacing)
    core = ndimage.binary_erosion(rough, iterations=3)
    around = np.exp(_local_mean(np.log(np.maximum(smooth, threshold)), core, 12.0 / volume.spacing))
    fine = (smooth > air + 0.5 * (nearby - air)) & (smooth > GHOST_SHARE * around) & (nearby > 0.0)
    return _solid(fine | core)


def _local_mean(values: NDArray[np.float32], mask: Bools, sigma: NDArray[np.float64]) -> NDArray[np.float32]:
    """Mean of the masked values nearby, by a Gaussian of `sigma` voxels; 0 far from the mask."""
    weight = ndimage.gaussian_filter(mask.astype(np.float32), sigma, truncate=2.5)
    total = ndimage.gaussian_filter(np.where(mask, values, np.float32(0.0)), sigma, truncate=2.5)
    return np.asarray(np.where(weight > 0.02, total / np.maximum(weight, 0.02), 0.0), dtype=np.float32)


def _solid(bright: Bools) -> Bools:
    """Largest piece of a bright region with its holes filled and its skin closed."""
    closed = ndimage.binary_closing(bright, ndimage.generate_binary_structure(3, 1), iterations=2, border_value=0)
    body = ~outside_air(~(closed | bright))
    opened = ndimage.binary_opening(body, iterations=2)
    label, count = ndimage.label(opened)
    if count == 0:
        raise DataError("no body found in the MR volume: check that it shows the breast")
    largest = 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    return np.asarray(ndimage.binary_dilation(label == largest, iterations=2) & body, dtype=np.bool_)
