"""Exponential law (Wellman; Azar; Krouskop's gland)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mammoreg.arrays import Floats
from mammoreg.materials.uniaxial import UniaxialLaw


@dataclass(frozen=True)
class Exponential(UniaxialLaw):
    """s = b/m (exp(m e) - 1), b in kPa, followed up to a compression of 60 %."""

    b_kpa: float
    m: float

    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress at compressions of any shape."""
        return np.asarray(self.b_kpa / self.m * np.expm1(self.m * np.asarray(compression, dtype=float)))

    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """Slope of the stress, b exp(m e)."""
        return np.asarray(self.b_kpa * np.exp(self.m * np.asarray(compression, dtype=float)))

    def work_kpa(self, compression: ArrayLike) -> Floats:
        """Integral of the stress."""
        compression = np.asarray(compression, dtype=float)
        return np.asarray(self.b_kpa / self.m * (np.expm1(self.m * compression) / self.m - compression))
