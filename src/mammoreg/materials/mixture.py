"""Elements of mixed tissue: energies weighted by the tissues' fractions of the volume."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.materials.isochoric import IsochoricLaw


@dataclass(frozen=True)
class TissueMixture:
    """W = sum of fraction_t W_t(I1bar), one mixture per element (equal strain in all tissues).

    Attributes:
        laws: of T tissues.
        fractions: of the volume (E, T), not negative, each row's sum 1.

    Raises:
        ValueError: other shapes, or fractions that are not such.
    """

    laws: tuple[IsochoricLaw, ...]
    fractions: Floats

    def __post_init__(self) -> None:
        if self.fractions.ndim != 2 or self.fractions.shape[1] != len(self.laws):
            raise ValueError(
                f"{len(self.laws)} tissues need fractions (E, {len(self.laws)}), not {self.fractions.shape}"
            )
        wrong = np.flatnonzero((self.fractions < -1e-9).any(axis=1) | ~np.isclose(self.fractions.sum(axis=1), 1.0))
        if wrong.size:
            raise ValueError(f"element {wrong[0]}: fractions of tissue must not be negative and add up to 1")

    @property
    def mu_kpa(self) -> Floats:
        """Initial shear modulus (E,)."""
        return np.asarray(self.fractions @ np.array([law.mu_kpa for law in self.laws]))

    def part(self, elements: slice | NDArray[np.integer]) -> "TissueMixture":
        """The mixture of some elements."""
        return TissueMixture(self.laws, self.fractions[elements])

    def energy_kpa(self, i1: Floats) -> Floats:
        """W at I1bar (E, Q)."""
        return self._sum([law.energy_kpa for law in self.laws], i1)

    def slope_kpa(self, i1: Floats) -> Floats:
        """W' at I1bar (E, Q)."""
        return self._sum([law.slope_kpa for law in self.laws], i1)

    def curvature_kpa(self, i1: Floats) -> Floats:
        """W'' at I1bar (E, Q)."""
        return self._sum([law.curvature_kpa for law in self.laws], i1)

    def _sum(self, functions: list[Callable[[Floats], Floats]], i1: Floats) -> Floats:
        """A tissue costs nothing where it has none."""
        total = np.zeros(i1.shape)
        for fraction, function in zip(self.fractions.T, functions, strict=True):
            there = np.flatnonzero(fraction)
            if there.size == len(fraction):
                total += fraction[:, None] * function(i1)
            elif there.size:
                total[there] += fraction[there, None] * function(i1[there])
        return total
