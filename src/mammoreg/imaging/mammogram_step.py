"""The grey step across a breast's outline: what tells skin against air from a level that runs through glowing air."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.imaging.mammogram_polyline import across, grey_values, outward_normals

# All chosen. On 22 real mammograms of several detectors nine tenths of a right outline have a step of at least 0.008
# of the breast's range, one through glowing air at most 0.003.
LEAST_STEP_SHARE = 0.006  # of the breast's range of grey values
_LEAST_QUANTA = 1.5  # one grey value is how a slope looks after rounding
_NOISE_SIGMAS = 4.0
_NEAR_MM = 1.0  # on either side, within which the step is sought
_FAR_MM = 5.0  # outside, up to which a slope would go on
_SAMPLING_MM = 0.25


@dataclass(frozen=True)
class GreyScale:
    """What grey values mean in an image.

    Attributes:
        reach: from air to dense tissue.
        least_step: below this a difference is rounding or noise.
    """

    reach: float
    least_step: float


@dataclass(frozen=True)
class GreyStep:
    """The step across an outline, as shares of the breast's range of grey values.

    Attributes:
        height: (M,), brightest within 1 mm inside less darkest within 1 mm outside.
        stands: (M,), whether it is above noise and rounding, and steeper than what goes on outside: a slope is none.
    """

    height: NDArray[np.float64]
    stands: NDArray[np.bool_]


def grey_scale(pixels: Floats32, smooth: Floats32, air_level: float, threshold: float, noise: float) -> GreyScale:
    """Range of the breast's grey values and the least difference that means something.

    Args:
        pixels: canonical image as it is stored, by whose rounding one grey value is known.
        smooth: the same, in which steps are sought.
        threshold: grey value between air and tissue.
        noise: standard deviation of `smooth` in the air.
    """
    tissue = smooth[smooth > threshold]
    reach = max((float(np.percentile(tissue, 90)) if tissue.size else 0.0) - air_level, 1e-12)
    return GreyScale(
        reach, max(LEAST_STEP_SHARE * reach, _LEAST_QUANTA * _quantum(pixels, reach), _NOISE_SIGMAS * noise)
    )


def grey_step(smooth: Floats32, outline: NDArray[np.float64], pixel_mm: float, scale: GreyScale) -> GreyStep:
    """Measure the step across an outline (M, 2) of (column, row), which runs as `outward_normals` wants it."""
    at = np.arange(-_NEAR_MM, _FAR_MM + 0.5 * _SAMPLING_MM, _SAMPLING_MM)
    values = grey_values(smooth, across(outline, outward_normals(outline), at / pixel_mm))
    near = np.abs(at) < _NEAR_MM + 0.5 * _SAMPLING_MM
    outside = values[:, near & (at >= 0.0)].min(axis=1)
    height = values[:, near & (at <= 0.0)].max(axis=1) - outside
    slope = outside - values[:, ~near].min(axis=1)
    stands = (height >= scale.least_step) & (height > slope)
    return GreyStep(np.asarray(height / scale.reach, dtype=float), np.asarray(stands, dtype=bool))


def _quantum(pixels: Floats32, reach: float) -> float:
    """The smallest difference of two grey values, of an image that has few of them; 0 where it has many."""
    values = np.unique(pixels[::3, ::3])
    few = values.size > 1 and values.size < 1024
    return float(np.diff(values).min()) if few and np.ptp(values) > 0.1 * reach else 0.0
