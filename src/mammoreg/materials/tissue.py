"""Tissue of a breast as the settings choose it: homogeneous, gland stiffer than fat, or one of the paper's models."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.materials.catalogue import CATALOGUE
from mammoreg.materials.elastic import ElasticMaterial, hyperelastic, neo_hookean, tangent_bulk_kpa
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.laws import Law
from mammoreg.materials.mixture import TissueMixture

PaperMaterial = Literal["wellman", "azar", "samani", "homogeneous", "krouskop", "bakic", "lorenzen"]
MaterialName = Literal[PaperMaterial, "fat_and_gland"]
MATERIALS: tuple[PaperMaterial, ...] = get_args(PaperMaterial)
"""Those of Table II."""


@dataclass(frozen=True)
class BreastTissue:
    """A material, and how stiff it is.

    Attributes:
        material: of the elements, without fibres.
        mu_kpa: shear modulus of the whole at the compression to come: the neo-Hookean one of the same stress.
        stiffness_ratio: slope of the stress there over the initial one.
    """

    material: ElasticMaterial
    mu_kpa: float
    stiffness_ratio: float = 1.0

    def with_fibres(self, direction: Floats, ratio: float) -> "BreastTissue":
        """The tissue with fibres along a direction (3,), `ratio` times as stiff in tension as the whole in shear."""
        return replace(self, material=replace(self.material, fibres=Fibres(direction, ratio * self.mu_kpa)))


def neo_hookean_tissue(
    mu_kpa: float, poisson: float, contrast: float = 1.0, gland: Floats | None = None
) -> BreastTissue:
    """Homogeneous tissue, or gland `contrast` times as stiff as fat.

    Args:
        mu_kpa: shear modulus, the elements' mean where gland differs from fat.
        poisson: Poisson's ratio.
        contrast: of the shear moduli.
        gland: share of gland in each element (E,), looked at where the contrast is not 1.
    """
    if contrast == 1.0:
        return BreastTissue(neo_hookean(mu_kpa, poisson), mu_kpa)
    relative = 1.0 + (contrast - 1.0) * _known(gland)
    return BreastTissue(neo_hookean(mu_kpa * relative / float(relative.mean()), poisson), mu_kpa)


def catalogue_tissue(name: str, poisson: float, gland: Floats | None, compression: float) -> BreastTissue:
    """Fat and gland of one of the paper's models, mixed in each element by their shares.

    A bulk modulus tied to the initial stiffness would let tissue that stiffens a hundredfold change its volume. So each
    tissue's is tied, by Poisson's ratio, to the stiffness that it reaches at the compression of the view.

    Args:
        name: of the catalogue.
        poisson: Poisson's ratio at that stiffness.
        gland: share of gland in each element (E,).
        compression: share of its thickness that the plates will take from the breast.
    """
    entry, fraction = CATALOGUE[name], _known(gland)
    laws = (entry.fat.law, entry.gland.law)
    fractions = np.stack([1.0 - fraction, fraction], axis=-1)
    bulk = fractions @ np.array([max(tangent_bulk_kpa(law, e, poisson) for e in (0.0, compression)) for law in laws])
    mixture = TissueMixture(laws, fractions)
    mu = float((fractions @ np.array([_stress_mu_kpa(law, compression) for law in laws])).mean())
    material = hyperelastic(mixture, poisson, bulk)
    return BreastTissue(material, mu, float(material.reached_mu_kpa(compression).mean() / material.mu_kpa.mean()))


def _stress_mu_kpa(law: Law, compression: float) -> float:
    """Shear modulus of the neo-Hookean law that has the stress of another one at a uniaxial compression."""
    if compression == 0.0:
        return law.mu_kpa
    stretch = 1.0 - compression
    return float(law.stress_kpa(compression)) / (stretch**-2 - stretch)


def _known(gland: Floats | None) -> Floats:
    if gland is None:
        raise ValueError("a material that tells gland from fat needs the share of gland in each element")
    return gland
