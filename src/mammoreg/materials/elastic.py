"""Material of a finite-element body: isochoric law, bulk modulus and fibres of each element."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.isochoric import IsochoricLaw
from mammoreg.materials.mixture import TissueMixture
from mammoreg.materials.neo_hookean import NeoHookean
from mammoreg.materials.uniaxial import UniaxialLaw


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
    """Constants of a nearly incompressible body.

    Attributes:
        mu_kpa: initial shear modulus, scalar or (E,).
        bulk_kpa: bulk modulus K of K/2 (J - 1)^2, scalar or (E,).
        fibres: reinforcement in tension, if any.
        law: isochoric law of all elements, or their mixture; None: neo-Hookean with `mu_kpa`, whose tangent has no
            term of curvature to compute.
    """

    mu_kpa: Floats
    bulk_kpa: Floats
    fibres: Fibres | None = None
    law: IsochoricLaw | TissueMixture | None = None

    def of_elements(self, count: int) -> "ElasticMaterial":
        """The same constants with one value per element.

        Raises:
            ValueError: moduli that are not positive, or a mixture of another number of elements.
        """
        mu = np.broadcast_to(np.asarray(self.mu_kpa, dtype=float), (count,)).copy()
        bulk = np.broadcast_to(np.asarray(self.bulk_kpa, dtype=float), (count,)).copy()
        if not (np.all(mu > 0.0) and np.all(bulk > 0.0)):
            raise ValueError("shear and bulk moduli must be positive")
        fibres = None if self.fibres is None else self.fibres.of_elements(count)
        return ElasticMaterial(mu, bulk, fibres, self.law)

    def part(self, elements: slice | NDArray[np.integer]) -> "ElasticMaterial":
        """The material of some elements; needs one value per element."""
        law = self.law.part(elements) if isinstance(self.law, TissueMixture) else self.law
        fibres = None if self.fibres is None else self.fibres.part(elements)
        return ElasticMaterial(self.mu_kpa[elements], self.bulk_kpa[elements], fibres, law)

    def reached_mu_kpa(self, compression: float) -> Floats:
        """Shear modulus that elements (E,) have reached at a uniaxial compression, a third of the slope of the stress.

        The scale for what must hold against laws that stiffen by orders of magnitude, as a contact's penalty. The
        initial modulus for neo-Hookean bodies; needs one value per element.
        """
        if self.law is None:
            return self.mu_kpa
        stretch = 1.0 - compression
        i1 = np.full((len(self.mu_kpa), 1), stretch**2 + 2.0 / stretch)
        slope, curvature = self.law.slope_kpa(i1)[:, 0], self.law.curvature_kpa(i1)[:, 0]
        tangent = 2.0 * slope * (2.0 * stretch**-3 + 1.0) + 4.0 * curvature * (stretch**-2 - stretch) ** 2
        return np.asarray(tangent / 3.0)


def neo_hookean(
    mu_kpa: float | Floats,
    poisson: float = 0.495,
    fibre: Floats | None = None,
    fibre_kpa: float | Floats | None = None,
    stiffening: float = 0.0,
) -> ElasticMaterial:
    """Neo-Hookean material whose bulk modulus follows from Poisson's ratio.

    Args:
        mu_kpa: shear modulus, scalar or (E,).
        poisson: Poisson's ratio.
        fibre, fibre_kpa, stiffening: direction, stiffness and stiffening as in `Fibres`; none without a stiffness.
    """
    mu = np.asarray(mu_kpa, dtype=float)
    fibres = None if fibre is None or fibre_kpa is None else Fibres(fibre, fibre_kpa, stiffening)
    return ElasticMaterial(mu, mu * bulk_ratio(poisson), fibres)


def hyperelastic(
    law: IsochoricLaw | TissueMixture,
    poisson: float = 0.495,
    bulk_kpa: float | Floats | None = None,
    fibres: Fibres | None = None,
) -> ElasticMaterial:
    """Material of any isochoric law, or of a mixture of tissues.

    Args:
        law: of all elements, or a mixture with one row per element.
        poisson: gives the bulk modulus over the initial shear modulus where `bulk_kpa` does not.
        bulk_kpa: bulk modulus, scalar or (E,). Laws that stiffen by orders of magnitude need it: see
            `tangent_bulk_kpa`.
        fibres: reinforcement in tension.
    """
    mu = np.asarray(law.mu_kpa, dtype=float)
    bulk = mu * bulk_ratio(poisson) if bulk_kpa is None else np.asarray(bulk_kpa, dtype=float)
    plain = all(isinstance(one, NeoHookean) for one in (law.laws if isinstance(law, TissueMixture) else (law,)))
    return ElasticMaterial(mu, bulk, fibres, None if plain else law)


def tangent_bulk_kpa(law: UniaxialLaw | NeoHookean, compression: float, poisson: float = 0.495) -> float:
    """Bulk modulus tied to the stiffness that a law has reached at a compression.

    Its ratio to a third of the tangent ds/de there, the shear modulus of that stiffness, is the one of Poisson's ratio.
    """
    return float(law.tangent_kpa(compression)) / 3.0 * bulk_ratio(poisson)
