"""First invariant of an incompressible membrane, as it is and relaxed where the membrane wrinkles or hangs slack.

With the in-plane right Cauchy-Green tensor C (2 x 2) and the thickness that incompressibility leaves, C33 = 1/det C,
an isotropic membrane whose energy is a growing function of I1 has I1 = tr C + 1/det C. Under in-plane compression it
buckles at once: the relaxed energy (Pipkin, IMA J Appl Math 1986;36:85-99) takes the width that the membrane would
have under the tension alone. For every function of I1 that natural width is l2 = l1^-1/2, so relaxing the invariant
relaxes the energy whatever the law:

    taut      l2^2 >= 1/l1        I1 = l1^2 + l2^2 + 1/(l1 l2)^2
    wrinkled  l2^2 < 1/l1, l1 > 1 I1 = l1^2 + 2/l1
    slack     l1 <= 1             I1 = 3
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats

_TO_STRAIN = np.array([2.0, 2.0, 1.0])
"""(C11, C22, C12) changes by this times the Green strain (E11, E22, 2 E12)."""
_HALF_DIFFERENCE = np.array([0.5, -0.5, 0.0])
_SHEAR = np.array([0.0, 0.0, 1.0])
_MEAN = np.array([0.5, 0.5, 0.0])
_DETERMINANT = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -2.0]])


@dataclass(frozen=True)
class Invariant:
    """I1 and its derivatives by the Green strain (E11, E22, 2 E12).

    Attributes:
        value: (...,).
        gradient: (..., 3).
        hessian: (..., 3, 3), symmetric.
    """

    value: Floats
    gradient: Floats
    hessian: Floats


def full_invariant(stretch: Floats) -> Invariant:
    """I1 = tr C + 1/det C of in-plane tensors C as (..., 3): C11, C22, C12."""
    c11, c22, c12 = stretch[..., 0], stretch[..., 1], stretch[..., 2]
    inverse = 1.0 / (c11 * c22 - c12**2)
    slope = np.stack([c22, c11, -2.0 * c12], axis=-1)
    gradient = 2.0 * _MEAN - (inverse**2)[..., None] * slope
    hessian = (2.0 * inverse**3)[..., None, None] * _dyad(slope) - (inverse**2)[..., None, None] * _DETERMINANT
    return _by_strain(c11 + c22 + inverse, gradient, hessian)


def relaxed_invariant(stretch: Floats) -> Invariant:
    """I1 of the membrane that wrinkles, of in-plane tensors C as (..., 3): C11, C22, C12."""
    middle = 0.5 * (stretch[..., 0] + stretch[..., 1])
    difference = stretch @ _HALF_DIFFERENCE
    radius = np.hypot(difference, stretch[..., 2])
    largest = middle + radius
    taut = middle - radius >= largest**-0.5
    wrinkled = ~taut & (largest > 1.0)
    full, uniaxial = full_invariant(stretch), _uniaxial(stretch, largest, difference, np.where(wrinkled, radius, 1.0))
    return Invariant(
        np.where(taut, full.value, np.where(wrinkled, uniaxial.value, 3.0)),
        _chosen(taut, full.gradient, wrinkled, uniaxial.gradient),
        _chosen(taut, full.hessian, wrinkled, uniaxial.hessian),
    )


def _uniaxial(stretch: Floats, largest: Floats, difference: Floats, radius: Floats) -> Invariant:
    """I1 = c + 2 c^-1/2 of the largest eigenvalue c; the eigenvalues differ by twice the radius."""
    cosine, sine = (difference / radius)[..., None], (stretch[..., 2] / radius)[..., None]
    along = _MEAN + cosine * _HALF_DIFFERENCE + sine * _SHEAR
    turning = cosine * _SHEAR - sine * _HALF_DIFFERENCE
    slope, curvature = 1.0 - largest**-1.5, 1.5 * largest**-2.5
    hessian = curvature[..., None, None] * _dyad(along) + (slope / radius)[..., None, None] * _dyad(turning)
    return _by_strain(largest + 2.0 * largest**-0.5, slope[..., None] * along, hessian)


def _by_strain(value: Floats, gradient: Floats, hessian: Floats) -> Invariant:
    return Invariant(value, gradient * _TO_STRAIN, hessian * _TO_STRAIN[:, None] * _TO_STRAIN)


def _chosen(first: NDArray[np.bool_], one: Floats, second: NDArray[np.bool_], other: Floats) -> Floats:
    spread = (...,) + (None,) * (one.ndim - first.ndim)
    return np.where(first[spread], one, np.where(second[spread], other, 0.0))


def _dyad(vector: Floats) -> Floats:
    return np.asarray(vector[..., :, None] * vector[..., None, :])
