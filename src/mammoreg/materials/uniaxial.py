"""From a one-dimensional law of compression to an isochoric law W(I1bar), exact in uniaxial compression.

The stretch l in (0, 1] of uniaxial compression is a function of I1 = l^2 + 2/l, hence with the nominal stress s over
the engineering compression e = 1 - l (design data, materials, "From a 1-D law to 3-D")

    W(I1) = integral of s de,  W'(I1) = s / (2 (l^-2 - l)) = s/e l^2 / (2 (1 + l + l^2)).

In simple shear by g, I1 = 3 + g^2 and the shear stress is 2 W' g. Its slope 2 W' + 4 W'' g^2 decides whether the law is
well posed: the stretches of any isochoric deformation hold (l_max - l_min)^2 <= I1 - 3, with equality in simple shear,
so that Legendre and Hadamard's condition, W' + 2 W'' (l_max - l_min)^2 > 0, holds at all of them exactly if it holds in
shear. A law that is linear in compression loses it at 49.4 %.

Hence a law is followed while that slope is at least `LEAST_SHEAR` of mu; from there to its limit, and beyond the limit,
the shear stress grows linearly: stress stays continuous and shear monotone without end.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mammoreg.arrays import Floats

LIMIT = 0.6
LEAST_SHEAR = 0.02
"""Smallest slope of the shear stress over the shear, relative to mu, at which a law is followed."""
_AT_REST, _NEAR_REST = 1e-12, 1e-5
_SAMPLES = 601


@dataclass(frozen=True)
class ShearLine:
    """Shear stress that grows linearly from a shear on, kPa.

    Attributes:
        compression, shear: where it begins; uniaxial compression and simple shear of the same I1.
        energy, stress, tangent: there.
    """

    compression: float
    shear: float
    energy: float
    stress: float
    tangent: float

    def energy_kpa(self, shear: Floats) -> Floats:
        """W at shears."""
        further = shear - self.shear
        return np.asarray(self.energy + self.stress * further + 0.5 * self.tangent * further**2)

    def slope_kpa(self, shear: Floats) -> Floats:
        """W' at shears."""
        return np.asarray(0.5 * (self.tangent + self._offset / shear))

    def curvature_kpa(self, shear: Floats) -> Floats:
        """W'' at shears."""
        return np.asarray(-0.25 * self._offset / shear**3)

    @property
    def _offset(self) -> float:
        return self.stress - self.tangent * self.shear


class UniaxialLaw(ABC):
    """A law of compression as an isochoric law.

    Tension and shear follow from I1bar alone: a test in compression says nothing else about them. W'' grows like 1/e
    near e = 0 unless s'' fits; there its product with the tensors of the tangent vanishes like e. It is held below
    e = 1e-5, which changes no stress, and the tangent by less than 1e-4 of mu.
    """

    @property
    def limit(self) -> float:
        """Compression up to which the law is to be followed."""
        return LIMIT

    @abstractmethod
    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress (force over undeformed area), positive, at engineering compressions of any shape."""

    @abstractmethod
    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """Slope of the nominal stress."""

    @abstractmethod
    def work_kpa(self, compression: ArrayLike) -> Floats:
        """Integral of the nominal stress from 0."""

    @cached_property
    def mu_kpa(self) -> float:
        """Initial shear modulus: a third of the initial tangent."""
        return float(self.tangent_kpa(0.0)) / 3.0

    @cached_property
    def exact_to(self) -> float:
        """Compression up to which the law is followed exactly."""
        from scipy.optimize import brentq

        def reserve(compression: Floats) -> Floats:
            return self._shear_tangent(compression) - LEAST_SHEAR * self.mu_kpa

        samples = np.linspace(0.0, self.limit, _SAMPLES)
        short = np.flatnonzero(reserve(samples) < 0.0)
        if not short.size:
            return self.limit
        return float(brentq(lambda e: float(reserve(np.array(e))), samples[short[0] - 1], samples[short[0]]))

    @cached_property
    def lines(self) -> tuple[ShearLine, ...]:
        """What follows where the law ends: towards its limit if it had to be left earlier, and beyond the limit."""
        start = self.exact_to
        shear = float(simple_shear(np.array(start)))
        stress = 2.0 * shear * float(self._slope(np.array(start)))
        tangent = float(self._shear_tangent(np.array(start)))
        found = [ShearLine(start, shear, float(self.work_kpa(start)), stress, tangent)]
        if start < self.limit:
            shear = float(simple_shear(np.array(self.limit)))
            at_limit = np.array(shear)
            stress = 2.0 * shear * float(found[0].slope_kpa(at_limit))
            found.append(ShearLine(self.limit, shear, float(found[0].energy_kpa(at_limit)), stress, tangent))
        last = found.pop()
        # The secant, a neo-Hookean law, keeps softening laws stiff; the tangent keeps hardening ones smooth.
        stiffest = max(last.tangent, last.stress / last.shear)
        return (*found, ShearLine(last.compression, last.shear, last.energy, last.stress, stiffest))

    def energy_kpa(self, i1: Floats) -> Floats:
        """W(I1bar)."""
        compression, shear = _equivalents(i1)
        return self._continued(self.work_kpa(np.minimum(compression, self.exact_to)), compression, shear, "energy_kpa")

    def slope_kpa(self, i1: Floats) -> Floats:
        """W'(I1bar)."""
        compression, shear = _equivalents(i1)
        return self._continued(self._slope(np.minimum(compression, self.exact_to)), compression, shear, "slope_kpa")

    def curvature_kpa(self, i1: Floats) -> Floats:
        """W''(I1bar)."""
        compression, shear = _equivalents(i1)
        exact = self._curvature(np.minimum(compression, self.exact_to))
        return self._continued(exact, compression, shear, "curvature_kpa")

    def _continued(self, values: Floats, compression: Floats, shear: Floats, quantity: str) -> Floats:
        """Values of the exact law replaced by those of the lines where these hold."""
        values = np.array(values)
        for line in self.lines:
            beyond = compression > line.compression
            if beyond.any():
                values[beyond] = getattr(line, quantity)(shear[beyond])
        return values

    def _slope(self, compression: Floats) -> Floats:
        """W' as a function of the compression."""
        compression = np.maximum(compression, _AT_REST)
        return np.asarray(self.stress_kpa(compression) / compression * _strain_ratio(1.0 - compression))

    def _curvature(self, compression: Floats) -> Floats:
        """W'' as a function of the compression: (dW'/de) / (dI1/de)."""
        compression = np.maximum(compression, _NEAR_REST)
        stretch = 1.0 - compression
        secant = self.stress_kpa(compression) / compression
        bend = (self.tangent_kpa(compression) - secant) / compression
        ratio = _strain_ratio(stretch)
        # d ratio / de, and dI1/de = 2 (l^-2 - l) = e / ratio
        rate = -0.5 * stretch * (2.0 + stretch) / (1.0 + stretch + stretch**2) ** 2
        return np.asarray((bend * ratio + secant * rate) * ratio / compression)

    def _shear_tangent(self, compression: Floats) -> Floats:
        """Slope of the shear stress over the shear whose I1 is that of a compression."""
        shear = simple_shear(compression)
        return np.asarray(2.0 * self._slope(compression) + 4.0 * shear**2 * self._curvature(compression))


def uniaxial_compression(i1: Floats) -> Floats:
    """Compression e = 1 - l of the root l in (0, 1] of I1 = l^2 + 2/l, in closed form; I1 below 3 counts as 3."""
    return _equivalents(i1)[0]


def simple_shear(compression: Floats) -> Floats:
    """Simple shear g of the same I1 = 3 + g^2 as a uniaxial compression."""
    return np.asarray(compression * np.sqrt((3.0 - compression) / (1.0 - compression)))


def _equivalents(i1: Floats) -> tuple[Floats, Floats]:
    """Uniaxial compression and simple shear of the same I1.

    The cubic's trigonometric root, arranged so that nothing cancels near I1 = 3.
    """
    excess = np.maximum(np.asarray(i1, dtype=float) - 3.0, 0.0)
    third = excess / 3.0
    angle = np.arctan(np.sqrt(third * (3.0 + third * (3.0 + third)))) / 3.0
    root = np.sqrt(1.0 + third)
    stretch_less_one = root * (np.cos(angle) - np.sqrt(3.0) * np.sin(angle)) - 1.0
    return np.maximum(-stretch_less_one, 0.0), np.sqrt(excess)


def _strain_ratio(stretch: Floats) -> Floats:
    """Ratio e / (2 (l^-2 - l)) without its 0/0 at rest."""
    return np.asarray(0.5 * stretch**2 / (1.0 + stretch + stretch**2))
