"""Fat that Cooper's ligaments harden (Azar, after the paper's section II-B).

Azar's threshold and stiffness were not found in any public source: the form and its constants are this project's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mammoreg.arrays import Floats
from mammoreg.materials.exponential import Exponential
from mammoreg.materials.uniaxial import UniaxialLaw

EARLIEST_ONSET = 0.21
"""Table I shows no hardening at this compression."""


@dataclass(frozen=True)
class HardenedFat(UniaxialLaw):
    """s = s_fat + H(e - e0) b/m (exp(m (e - e0)) - 1), followed up to 60 %.

    Attributes:
        fat: law without ligaments.
        gland: law that the hardened fat never exceeds in stiffness.
        onset: e0.
        b_kpa, m: of the ligaments.

    Raises:
        ValueError: the ligaments act below 21 %, where Table I shows none, or make fat stiffer than gland.
    """

    fat: Exponential
    gland: Exponential
    onset: float
    b_kpa: float
    m: float

    def __post_init__(self) -> None:
        if self.onset < EARLIEST_ONSET:
            raise ValueError(
                f"ligaments must not act below {EARLIEST_ONSET:.0%} compression, not from {self.onset:.0%}"
            )
        compressions = np.linspace(0.0, self.limit, 121)
        stiffer = compressions[self.tangent_kpa(compressions) > self.gland.tangent_kpa(compressions)]
        if stiffer.size:
            raise ValueError(f"fat becomes stiffer than gland at {stiffer[0]:.1%}: choose softer ligaments")

    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress at compressions of any shape."""
        return self.fat.stress_kpa(compression) + self._ligaments.stress_kpa(self._beyond(compression))

    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """Slope of the stress; it jumps by b at the onset."""
        taut = np.asarray(compression, dtype=float) > self.onset
        ligaments = self._ligaments.tangent_kpa(self._beyond(compression))
        return self.fat.tangent_kpa(compression) + np.where(taut, ligaments, 0.0)

    def work_kpa(self, compression: ArrayLike) -> Floats:
        """Integral of the stress."""
        return self.fat.work_kpa(compression) + self._ligaments.work_kpa(self._beyond(compression))

    def _beyond(self, compression: ArrayLike) -> Floats:
        return np.asarray(np.maximum(np.asarray(compression, dtype=float) - self.onset, 0.0))

    @property
    def _ligaments(self) -> Exponential:
        return Exponential(self.b_kpa, self.m)
