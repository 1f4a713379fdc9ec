"""One-dimensional laws of breast tissue: nominal stress over engineering compression (paper, Figure 2).

Compression e = 1 - l with the stretch l; nominal stress (force over undeformed area) in kPa, compression positive.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Exponential:
    """s = b/m (exp(m e) - 1) (Wellman; Azar), b in kPa."""

    b_kpa: float
    m: float

    def stress_kpa(self, compression: ArrayLike) -> Array:
        """Nominal stress at compressions of any shape."""
        return np.asarray(self.b_kpa / self.m * np.expm1(self.m * np.asarray(compression, dtype=float)))


@dataclass(frozen=True)
class NeoHookean:
    """s = mu (l^-2 - l), incompressible, mu in kPa (Samani; the paper's homogeneous tissue)."""

    mu_kpa: float

    def stress_kpa(self, compression: ArrayLike) -> Array:
        """Nominal stress at compressions of any shape."""
        stretch = 1.0 - np.asarray(compression, dtype=float)
        return np.asarray(self.mu_kpa * (stretch**-2 - stretch))


@dataclass(frozen=True)
class Linear:
    """s = E e, E in kPa (Bakic; Lorenzen; Krouskop's fat)."""

    e_kpa: float

    def stress_kpa(self, compression: ArrayLike) -> Array:
        """Nominal stress at compressions of any shape."""
        return np.asarray(self.e_kpa * np.asarray(compression, dtype=float))


Law = Exponential | NeoHookean | Linear
