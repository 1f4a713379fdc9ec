"""Closed forms for isochoric laws W(I1bar) with K/2 (J - 1)^2, each from dW/dI1 alone; forces per undeformed area.

Ogden, Non-linear Elastic Deformations (1984), sections 4.2 and 5.3; Green and Zerna, Theoretical Elasticity (1968),
chapter 3, for the sphere.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

Floats = NDArray[np.float64]
Slope = Callable[[float], float]
"""dW/dI1bar in kPa at an I1bar."""


def slope_of_uniaxial(stress_kpa: Callable[[float], float]) -> Slope:
    """dW/dI1 of the incompressible law whose nominal stress over uniaxial compression e = 1 - l is given.

    s = 2 W' (l^-2 - l) with I1 = l^2 + 2 / l, of which the root l <= 1 is taken.
    """

    def slope(i1: float) -> float:
        excess = max(i1 - 3.0, 1e-10)
        stretch = float(brentq(lambda length: length**2 + 2.0 / length - 3.0 - excess, 1e-3, 1.0))
        return stress_kpa(1.0 - stretch) / (2.0 * (stretch**-2 - stretch))

    return slope


def principal_stress(stretches: Floats, slope: Slope, bulk: float) -> Floats:
    """Kirchhoff stresses (3,) in kPa of principal stretches (3,)."""
    det = float(np.prod(stretches))
    squares = stretches**2 * det ** (-2.0 / 3.0)
    i1 = float(squares.sum())
    return np.asarray(2.0 * slope(i1) * (squares - i1 / 3.0) + bulk * (det - 1.0) * det)


def uniaxial(stretch: float, slope: Slope, bulk: float) -> tuple[float, float]:
    """Free lateral stretch, and nominal stress along the stretch."""

    def lateral(side: float) -> float:
        return float(principal_stress(np.array([side, side, stretch]), slope, bulk)[0])

    guess = stretch**-0.5
    side = float(brentq(lateral, 0.5 * guess, 2.0 * guess, xtol=1e-14))
    return side, float(principal_stress(np.array([side, side, stretch]), slope, bulk)[2]) / stretch


def equibiaxial(stretch: float, slope: Slope, bulk: float) -> tuple[float, float]:
    """Free thickness stretch, and nominal stress along either stretch."""

    def across(thick: float) -> float:
        return float(principal_stress(np.array([stretch, stretch, thick]), slope, bulk)[2])

    guess = stretch**-2
    thick = float(brentq(across, 0.5 * guess, 2.0 * guess, xtol=1e-14))
    return thick, float(principal_stress(np.array([stretch, stretch, thick]), slope, bulk)[0]) / stretch


def simple_shear(amount: float, slope: Slope) -> Floats:
    """Nominal traction (3,) on the face that slides along x, normal y; the volume is kept, so no pressure acts."""
    i1 = 3.0 + amount**2
    return 2.0 * slope(i1) * np.array([amount, 1.0 - i1 / 3.0, 0.0])


def sphere_pressure(inner: float, outer: float, deformed_inner: float, slope: Slope) -> float:
    """Inner pressure, kPa, of an incompressible spherical shell whose outside is free.

    p = integral of (dW/dl) / (l^3 - 1) dl from the outer to the inner hoop stretch, I1 = 2 l^2 + l^-4.
    """
    deformed_outer = (outer**3 + deformed_inner**3 - inner**3) ** (1.0 / 3.0)

    def integrand(hoop: float) -> float:
        i1 = 2.0 * hoop**2 + hoop**-4
        return slope(i1) * 4.0 * (hoop - hoop**-5) / (hoop**3 - 1.0)

    return float(quad(integrand, deformed_outer / outer, deformed_inner / inner, epsabs=1e-12, epsrel=1e-10)[0])
