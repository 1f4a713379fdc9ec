"""Correlation of two images."""

import numpy as np
from numpy.typing import NDArray

LEAST_PIXELS = 50


def correlation(first: NDArray[np.floating], second: NDArray[np.floating], where: NDArray[np.bool_]) -> float:
    """Normalised cross-correlation of two images of one shape inside a mask; nan below 50 pixels or contrast."""
    if int(np.count_nonzero(where)) < LEAST_PIXELS:
        return float("nan")
    a, b = np.asarray(first[where], dtype=float), np.asarray(second[where], dtype=float)
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / norm if norm > 0.0 else float("nan")
