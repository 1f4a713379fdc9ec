"""Law that is linear in compression (Bakic; Lorenzen; Krouskop's fat; the paper's skin)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mammoreg.arrays import Floats
from mammoreg.materials.uniaxial import UniaxialLaw


@dataclass(frozen=True)
class Linear(UniaxialLaw):
    """s = E e, E in kPa, up to 50 %; W' = E/2 l^2 / (1 + l + l^2).

    Its shear stress would fall from a compression of 49.4 % on. It is followed exactly to 48 %; its stress at 50 % is
    0.2 % too large, for the sake of a well-posed law; beyond 50 % W' is constant, as a neo-Hookean law's.
    """

    e_kpa: float

    @property
    def limit(self) -> float:
        """The paper's 50 %."""
        return 0.5

    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress at compressions of any shape."""
        return np.asarray(self.e_kpa * np.asarray(compression, dtype=float))

    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """The modulus."""
        return np.full(np.shape(compression), self.e_kpa)

    def work_kpa(self, compression: ArrayLike) -> Floats:
        """Integral of the stress."""
        return np.asarray(0.5 * self.e_kpa * np.asarray(compression, dtype=float) ** 2)
