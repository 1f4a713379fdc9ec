"""The paper's skin: linear in uniaxial tension (section II-D after Samani), as an isochoric law.

Skin around a breast is stretched, so the law is exact in tension: nominal stress E (l - 1) at the stretch l, and with
I1 = l^2 + 2/l and incompressibility W(I1) = E/2 (l - 1)^2. It goes on beyond the 50 % strain that the paper names.
"""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats

SKIN_MODULUS_KPA = 10.0
LEAST_INVARIANT = 3.0 + 1e-7
"""The slope has a kink at rest; its derivative is cut off at a strain of some 1e-4, where it no longer matters."""


@dataclass(frozen=True)
class TensionLinear:
    """W = E/2 (l - 1)^2, l the stretch of uniaxial tension at I1.

    Attributes:
        e_kpa: Young's modulus.
    """

    e_kpa: float = SKIN_MODULUS_KPA

    @property
    def mu_kpa(self) -> float:
        """Initial shear modulus."""
        return self.e_kpa / 3.0

    def energy_kpa(self, i1: Floats) -> Floats:
        """W at invariants of any shape."""
        return np.asarray(0.5 * self.e_kpa * (_uniaxial_stretch(i1) - 1.0) ** 2)

    def slope_kpa(self, i1: Floats) -> Floats:
        """dW/dI1 = E/2 l^2 / (l^2 + l + 1)."""
        stretch = _uniaxial_stretch(i1)
        return np.asarray(0.5 * self.e_kpa * stretch**2 / (stretch**2 + stretch + 1.0))

    def curvature_kpa(self, i1: Floats) -> Floats:
        """d2W/dI1^2."""
        invariant = np.maximum(i1, LEAST_INVARIANT)
        stretch = _uniaxial_stretch(invariant)
        by_stretch = 0.5 * self.e_kpa * (stretch**2 + 2.0 * stretch) / (stretch**2 + stretch + 1.0) ** 2
        return np.asarray(by_stretch * stretch / (3.0 * stretch**2 - invariant))


def _uniaxial_stretch(i1: Floats) -> Floats:
    """The root l >= 1 of l^2 + 2/l = I1."""
    invariant = np.maximum(i1, 3.0)
    angle = np.arccos(-((3.0 / invariant) ** 1.5))
    return np.asarray(2.0 * np.sqrt(invariant / 3.0) * np.cos(angle / 3.0))
