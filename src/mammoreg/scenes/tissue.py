"""Tissue of the synthetic breasts: fat of 1 kPa with a gland that is stiffer by the scenario's contrast."""

from dataclasses import dataclass

import numpy as np

from mammoreg.materials.elastic import ElasticMaterial, bulk_ratio, hyperelastic, tangent_bulk_kpa
from mammoreg.materials.exponential import Exponential
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.linear import Linear
from mammoreg.materials.mixture import TissueMixture
from mammoreg.materials.neo_hookean import NeoHookean
from mammoreg.scenes.gland import Floats

FAT_KPA = 1.0
"""Initial shear modulus of fat; the gland's goes up to the 1000 kPa of the paper's range."""
NIPPLE_AXIS = np.array([0.0, -1.0, 0.0])
"""Fibres run along it."""
FIBRE_RATIO = 1.0
"""Stiffness of fibres over the shear modulus around them."""
STIFFENING = 0.5
"""Of the fibres that stiffen (k2): sevenfold at a stretch of 1.7."""
FAT_EXPONENT, GLAND_EXPONENT = 7.4, 12.3
"""Of the exponential laws, Wellman's."""

Law = NeoHookean | Exponential | Linear


@dataclass(frozen=True)
class SceneTissue:
    """Strain energy of the elements, for the solver and, by itself, for the checks from outside.

    Attributes:
        mixture: isochoric laws of fat and gland.
        bulk_kpa: bulk modulus (E,) of K/2 (J - 1)^2.
        fibres: reinforcement, one per element, or None.
    """

    mixture: TissueMixture
    bulk_kpa: Floats
    fibres: Fibres | None

    def material(self) -> ElasticMaterial:
        """As the solver takes it."""
        return hyperelastic(self.mixture, bulk_kpa=self.bulk_kpa, fibres=self.fibres)

    def energy_kpa(self, gradient: Floats, det: Floats) -> Floats:
        """Isochoric strain energy (E, Q) per undeformed volume at F (E, Q, 3, 3) with its determinants."""
        scale = np.cbrt(det) ** -2
        energy = self.mixture.energy_kpa(scale * (gradient * gradient).sum(axis=(-1, -2)))
        if self.fibres is not None:
            along = gradient @ NIPPLE_AXIS
            energy = energy + self.fibres.energy_kpa(scale * (along * along).sum(axis=-1))
        return energy


def scene_tissue(material: str, poisson: float, contrast: float, compression: float, gland: Floats) -> SceneTissue:
    """Tissue of a scenario.

    K follows from Poisson's ratio and the initial shear modulus; that of the exponential law, whose stiffness grows
    a hundredfold, from the stiffness that fat reaches at the scenario's compression.

    Args:
        material: law, a level of the study.
        poisson: Poisson's ratio.
        contrast: gland's initial shear modulus over fat's.
        compression: share of the thickness that the plates take away.
        gland: its share of each element (E,).
    """
    fat, stiff = _law(material, 1.0), _law(material, contrast)
    mixture = TissueMixture((fat, stiff), np.stack([1.0 - gland, gland], axis=1))
    reached = tangent_bulk_kpa(fat, compression, poisson) if isinstance(fat, Exponential) else 0.0
    mu = mixture.mu_kpa
    bulk = np.maximum(FAT_KPA * bulk_ratio(poisson), reached) * mu / FAT_KPA
    if not material.endswith("fibres"):
        return SceneTissue(mixture, bulk, None)
    stiffening = STIFFENING if material == "stiffening_fibres" else 0.0
    return SceneTissue(mixture, bulk, Fibres(NIPPLE_AXIS, FIBRE_RATIO * mu, stiffening).of_elements(len(mu)))


def _law(material: str, contrast: float) -> Law:
    """Law of a tissue whose initial shear modulus is fat's times a contrast."""
    mu = FAT_KPA * contrast
    if material == "exponential":
        return Exponential(3.0 * mu, FAT_EXPONENT if contrast == 1.0 else GLAND_EXPONENT)
    if material == "linear":
        return Linear(3.0 * mu)
    return NeoHookean(mu)
