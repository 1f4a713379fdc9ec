"""Reinforcement along a fibre field, in tension only: the paper's macroscopic anisotropy (sections II-B and IV)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats

_LARGEST_EXPONENT = 5.0


@dataclass(frozen=True)
class Fibres:
    """W4 = k1/(2 k2) (exp(k2 <I4bar - 1>^2) - 1), or k1/2 <I4bar - 1>^2 where they do not stiffen (k2 = 0).

    Where k2 <I4bar - 1>^2 exceeds 5, dW4/dI4bar goes on linearly, so that no iterate overflows.

    Attributes:
        direction: undeformed, (3,) or (E, 3), in the frame of the mesh; any length but zero.
        stiffness_kpa: k1, scalar or (E,), not negative.
        stiffening: k2, the same for all elements, not negative.
    """

    direction: Floats
    stiffness_kpa: float | Floats
    stiffening: float = 0.0

    def of_elements(self, count: int) -> "Fibres":
        """One unit direction and one stiffness per element.

        Raises:
            ValueError: a negative stiffness or stiffening, or a direction of no length.
        """
        stiffness = np.broadcast_to(np.asarray(self.stiffness_kpa, dtype=float), (count,)).copy()
        if np.any(stiffness < 0.0) or self.stiffening < 0.0:
            raise ValueError("the fibres' stiffness must not be negative")
        direction = np.broadcast_to(np.asarray(self.direction, dtype=float), (count, 3))
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        if not np.all(length > 0.0):
            raise ValueError("a fibre's direction must have a length")
        return Fibres(direction / length, stiffness, self.stiffening)

    def part(self, elements: slice | NDArray[np.integer]) -> "Fibres":
        """Fibres of some elements; needs one value per element."""
        stiffness = np.asarray(self.stiffness_kpa)[elements]
        return Fibres(self.direction[elements], stiffness, self.stiffening)

    def energy_kpa(self, i4: Floats) -> Floats:
        """W4 at I4bar (E, Q)."""
        beyond = np.maximum(i4 - 1.0, 0.0)
        if self.stiffening == 0.0:
            return np.asarray(0.5 * self._constant * beyond**2)
        held = np.minimum(beyond, self._largest)
        energy = np.expm1(self.stiffening * held**2) / (2.0 * self.stiffening)
        slope, curvature = self._derivatives(held)
        further = beyond - held
        return np.asarray(self._constant * (energy + slope * further + 0.5 * curvature * further**2))

    def slope_kpa(self, i4: Floats) -> Floats:
        """dW4 / dI4bar at I4bar (E, Q)."""
        beyond = np.where(i4 > 1.0, i4 - 1.0, 0.0)
        if self.stiffening == 0.0:
            return np.asarray(self._constant * beyond)
        held = np.minimum(beyond, self._largest)
        slope, curvature = self._derivatives(held)
        return np.asarray(self._constant * (slope + curvature * (beyond - held)))

    def curvature_kpa(self, i4: Floats) -> Floats:
        """d2W4 / dI4bar^2 at I4bar (E, Q)."""
        tension = i4 > 1.0
        if self.stiffening == 0.0:
            return np.asarray(self._constant * tension)
        held = np.minimum(np.maximum(i4 - 1.0, 0.0), self._largest)
        return np.asarray(self._constant * self._derivatives(held)[1] * tension)

    @property
    def _constant(self) -> Floats:
        return np.asarray(self.stiffness_kpa, dtype=float)[:, None]

    @property
    def _largest(self) -> float:
        return float(np.sqrt(_LARGEST_EXPONENT / self.stiffening))

    def _derivatives(self, beyond: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of the energy over k1."""
        square = self.stiffening * beyond**2
        growth = np.exp(square)
        return beyond * growth, (1.0 + 2.0 * square) * growth
