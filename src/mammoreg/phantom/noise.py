"""Smooth random fields on small lattices, drawn from a seeded generator."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SmoothNoise:
    """A periodic random field of zero mean and unit variance.

    Attributes:
        lattice: samples (k, k, k) at integer coordinates.
    """

    lattice: NDArray[np.float32]

    @classmethod
    def draw(cls, random: Generator, size: int = 48, correlation: float = 1.5) -> "SmoothNoise":
        """White noise on a lattice of `size` a side, smoothed with a Gaussian of `correlation` lattice steps."""
        field = ndimage.gaussian_filter(random.standard_normal((size, size, size)), correlation, mode="wrap")
        return cls(np.asarray((field - field.mean()) / field.std(), dtype=np.float32))

    def at(self, coordinates: Array) -> NDArray[np.float32]:
        """Values (N,) at coordinates (N, 3) in lattice steps."""
        return np.asarray(
            ndimage.map_coordinates(self.lattice, coordinates.T, order=1, mode="grid-wrap", output=np.float32)
        )


def smooth_step(values: NDArray[np.float32], middle: float, width: float) -> NDArray[np.float32]:
    """0 below, 1 above `middle`, a linear ramp of `width` between."""
    return np.asarray(np.clip((values - np.float32(middle)) / np.float32(width) + np.float32(0.5), 0.0, 1.0))
