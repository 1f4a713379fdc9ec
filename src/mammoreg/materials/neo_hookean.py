"""Neo-Hookean law (Samani; the paper's homogeneous tissue)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mammoreg.arrays import Floats


@dataclass(frozen=True)
class NeoHookean:
    """W = mu/2 (I1bar - 3), mu in kPa; in uniaxial compression s = mu (l^-2 - l)."""

    mu_kpa: float

    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress at engineering compressions 1 - l of any shape."""
        stretch = 1.0 - np.asarray(compression, dtype=float)
        return np.asarray(self.mu_kpa * (stretch**-2 - stretch))

    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """Slope of the nominal stress."""
        stretch = 1.0 - np.asarray(compression, dtype=float)
        return np.asarray(self.mu_kpa * (2.0 * stretch**-3 + 1.0))

    def energy_kpa(self, i1: Floats) -> Floats:
        """W(I1bar)."""
        return np.asarray(0.5 * self.mu_kpa * (np.asarray(i1) - 3.0))

    def slope_kpa(self, i1: Floats) -> Floats:
        """W' = mu/2."""
        return np.full(np.shape(i1), 0.5 * self.mu_kpa)

    def curvature_kpa(self, i1: Floats) -> Floats:
        """W'' = 0."""
        return np.zeros(np.shape(i1))
