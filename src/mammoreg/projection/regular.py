"""Linear interpolation between regular grids, one axis at a time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def interpolate_axis(samples: NDArray[Any], index: NDArray[np.float64], axis: int) -> NDArray[np.float32]:
    """Samples along one axis at fractional indices (K,); half a sample beyond the ends the border value, then zero.

    Zero so that what a grid does not hold attenuates nothing.
    """
    size = samples.shape[axis]
    clipped = np.clip(index, 0.0, size - 1.0)
    low = np.minimum(clipped.astype(np.intp), max(size - 2, 0))
    high = np.minimum(low + 1, size - 1)
    shape = [1] * samples.ndim
    shape[axis] = len(index)
    held = ((index > -0.5) & (index < size - 0.5)).astype(np.float32)
    weight = (clipped - low).astype(np.float32).reshape(shape)
    held = held.reshape(shape)
    first, second = samples.take(low, axis=axis), samples.take(high, axis=axis)
    return np.asarray(first * (held * (1.0 - weight)) + second * (held * weight), dtype=np.float32)
