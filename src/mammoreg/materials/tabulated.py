"""Any one-dimensional table of stress over compression as a law."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from mammoreg.arrays import Floats
from mammoreg.materials.uniaxial import UniaxialLaw


@dataclass(frozen=True)
class Tabulated(UniaxialLaw):
    """Monotone cubic interpolation (PCHIP) of a table, followed up to its last compression.

    Attributes:
        compressions: engineering compressions, ascending, above 0 and below 1; the origin is added.
        stresses_kpa: nominal stresses, ascending.

    Raises:
        ValueError: fewer than two rows, other lengths, values that do not ascend or lie outside these bounds.
    """

    compressions: tuple[float, ...]
    stresses_kpa: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.compressions) != len(self.stresses_kpa) or len(self.compressions) < 2:
            raise ValueError("a stress-strain table needs two rows or more, each with a compression and a stress")
        table = np.array([(0.0, 0.0), *zip(self.compressions, self.stresses_kpa, strict=True)])
        falling = np.flatnonzero(~(np.diff(table, axis=0) > 0.0).all(axis=1))
        if falling.size:
            raise ValueError(f"stress-strain table, row {falling[0] + 1}: both columns must ascend from above 0")
        if not self.compressions[-1] < 1.0:
            raise ValueError(f"stress-strain table: compressions are shares below 1, not {self.compressions[-1]:g}")

    @property
    def limit(self) -> float:
        """The table's last compression."""
        return self.compressions[-1]

    def stress_kpa(self, compression: ArrayLike) -> Floats:
        """Nominal stress at compressions of any shape; beyond the table by its last slope."""
        inside, beyond = self._split(compression)
        return np.asarray(self._curve(inside) + self._curve(inside, 1) * beyond)

    def tangent_kpa(self, compression: ArrayLike) -> Floats:
        """Slope of the stress."""
        return np.asarray(self._curve(self._split(compression)[0], 1))

    def work_kpa(self, compression: ArrayLike) -> Floats:
        """Integral of the stress."""
        inside, beyond = self._split(compression)
        further = self._curve(inside) * beyond + 0.5 * self._curve(inside, 1) * beyond**2
        return np.asarray(self._curve.antiderivative()(inside) + further)

    def _split(self, compression: ArrayLike) -> tuple[Floats, Floats]:
        compression = np.asarray(compression, dtype=float)
        inside = np.minimum(compression, self.limit)
        return inside, compression - inside

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator((0.0, *self.compressions), (0.0, *self.stresses_kpa))
