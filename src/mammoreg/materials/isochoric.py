"""What the finite elements ask of a material: an isochoric strain energy W(I1bar) per undeformed volume."""

from typing import Protocol

from mammoreg.arrays import Floats


class IsochoricLaw(Protocol):
    """Energy in kPa (mJ/cm3) over the first invariant I1bar >= 3 of the isochoric left Cauchy-Green tensor.

    All functions take I1bar of any shape and return the same shape. The deviatoric Kirchhoff stress is
    2 W' dev(bbar), and W'' adds 4 W'' dev(bbar) x dev(bbar) to its tangent.
    """

    def energy_kpa(self, i1: Floats) -> Floats:
        """W(I1bar), zero at 3."""

    def slope_kpa(self, i1: Floats) -> Floats:
        """W' = dW / dI1bar, positive."""

    def curvature_kpa(self, i1: Floats) -> Floats:
        """W'' = d2W / dI1bar^2."""

    @property
    def mu_kpa(self) -> float:
        """Initial shear modulus 2 W'(3)."""
