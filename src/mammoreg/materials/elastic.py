"""Constants of the nearly incompressible material of a finite-element body."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bulk_ratio(poisson: float) -> float:
    """K / mu = 2 (1 + nu) / (3 (1 - 2 nu)) of linear elasticity.

    Raises:
        ValueError: nu is not in [0, 0.5).
    """
    if not 0.0 <= poisson < 0.5:
        raise ValueError(f"Poisson's ratio must be at least 0 and below 0.5, not {poisson}")
    return 2.0 * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))


@dataclass(frozen=True)
class ElasticMaterial:
    """Neo-Hookean with bulk modulus, optionally reinforced along a fibre in tension.

    Attributes:
        mu_kpa: shear modulus, scalar or (E,).
        bulk_kpa: bulk modulus K of K/2 (J - 1)^2, scalar or (E,).
        fibre: undeformed fibre directions, (3,) or (E, 3), in the frame of the mesh; any length but zero.
        fibre_kpa: stiffness k1 of k1/2 max(I4bar - 1, 0)^2, scalar or (E,).
    """

    mu_kpa: Array
    bulk_kpa: Array
    fibre: Array | None = None
    fibre_kpa: Array | None = None

    def of_elements(self, count: int) -> "ElasticMaterial":
        """The same constants with one value per element, fibres of unit length; raises ValueError if not positive."""
        mu = np.broadcast_to(np.asarray(self.mu_kpa, dtype=float), (count,)).copy()
        bulk = np.broadcast_to(np.asarray(self.bulk_kpa, dtype=float), (count,)).copy()
        if not (np.all(mu > 0.0) and np.all(bulk > 0.0)):
            raise ValueError("shear and bulk moduli must be positive")
        if self.fibre is None or self.fibre_kpa is None:
            return ElasticMaterial(mu, bulk)
        fibre = np.broadcast_to(np.asarray(self.fibre, dtype=float), (count, 3))
        stiffness = np.broadcast_to(np.asarray(self.fibre_kpa, dtype=float), (count,)).copy()
        if np.any(stiffness < 0.0):
            raise ValueError("the fibres' stiffness must not be negative")
        return ElasticMaterial(mu, bulk, fibre / np.linalg.norm(fibre, axis=1, keepdims=True), stiffness)


def neo_hookean(
    mu_kpa: float | Array,
    poisson: float = 0.495,
    fibre: Array | None = None,
    fibre_kpa: float | Array | None = None,
) -> ElasticMaterial:
    """Neo-Hookean material whose bulk modulus follows from Poisson's ratio; arguments as in `ElasticMaterial`."""
    mu = np.asarray(mu_kpa, dtype=float)
    stiffness = None if fibre_kpa is None else np.asarray(fibre_kpa, dtype=float)
    return ElasticMaterial(mu, mu * bulk_ratio(poisson), fibre, stiffness)
