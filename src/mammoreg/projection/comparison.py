"""Comparison of a method's projection with the mammogram."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.imaging.correlation import correlation

BREAST = 1


def projection_correlation(
    projection: Floats32,
    silhouette: NDArray[np.bool_],
    mammogram: NDArray[Any],
    labels: NDArray[np.integer],
    step: int,
) -> float:
    """Normalised cross-correlation of projection and mammogram where both show breast; nan where they hardly do.

    Args:
        projection, silhouette: by blocks of `step` x `step` pixels (`project_breast`).
        mammogram: canonical image (rows, columns), bright = dense.
        labels: of the mammogram: 0 air, 1 breast, 2 pectoral muscle, which is left out.
        step: side of the blocks.
    """
    breast = block_mean((labels == BREAST).astype(np.float32), step) >= 1.0
    return correlation(projection, block_mean(np.asarray(mammogram, dtype=np.float32), step), silhouette & breast)


def block_mean(image: Floats32, step: int) -> Floats32:
    """Means over blocks of `step` x `step` pixels; border blocks are filled up with the border's values."""
    rows, columns = (-(-size // step) * step for size in image.shape)
    padded = np.pad(image, ((0, rows - image.shape[0]), (0, columns - image.shape[1])), mode="edge")
    blocks = padded.reshape(rows // step, step, columns // step, step)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)
