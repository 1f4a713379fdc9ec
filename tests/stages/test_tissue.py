"""Tissue by settings: which stiffness it has, and what it asks for."""

import numpy as np
import pytest

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.materials.catalogue import CATALOGUE
from mammoreg.materials.elastic import bulk_ratio
from mammoreg.materials.tissue import MATERIALS, catalogue_tissue, neo_hookean_tissue

GLAND = np.array([0.0, 0.25, 1.0])


def test_every_model_of_the_paper_can_be_chosen():
    assert set(MATERIALS) == set(CATALOGUE)


@pytest.mark.parametrize("name", [m for m in MATERIALS if m != "homogeneous"])
@pytest.mark.parametrize("compression", [0.21, 0.5])
def test_elements_of_one_tissue_have_its_law_and_its_stress(name, compression):
    """The shear modulus of the whole gives, in a neo-Hookean cube, the mean stress of the elements."""
    tissue = catalogue_tissue(name, 0.495, GLAND, compression)
    entry = CATALOGUE[name]
    fat, gland = (t.law for t in (entry.fat, entry.gland))
    initial = [fat.mu_kpa, 0.75 * fat.mu_kpa + 0.25 * gland.mu_kpa, gland.mu_kpa]
    np.testing.assert_allclose(tissue.material.mu_kpa, initial)
    stresses = [float(law.stress_kpa(compression)) for law in (fat, gland)]
    stretch = 1.0 - compression
    mean = np.mean([stresses[0], 0.75 * stresses[0] + 0.25 * stresses[1], stresses[1]])
    assert tissue.mu_kpa * (stretch**-2 - stretch) == pytest.approx(mean)
    slopes = [
        1.0 if name == "samani" else float(law.tangent_kpa(compression)) / 3.0 / law.mu_kpa for law in (fat, gland)
    ]
    weighted = np.array([[1.0, 0.0], [0.75, 0.25], [0.0, 1.0]]) @ np.array(
        [fat.mu_kpa, gland.mu_kpa] * np.array(slopes)
    )
    if compression < 0.48:  # beyond, a linear law is continued
        assert tissue.stiffness_ratio == pytest.approx(weighted.sum() / np.sum(initial), rel=1e-6)


@pytest.mark.parametrize("name", [m for m in MATERIALS if m != "homogeneous"])
def test_bulk_modulus_is_that_of_the_stiffness_reached(name):
    ratio = bulk_ratio(0.495)
    low, high = (catalogue_tissue(name, 0.495, GLAND, e).material.bulk_kpa for e in (0.0, 0.4))
    np.testing.assert_allclose(low[[0, 2]], [ratio * CATALOGUE[name].fat.law.mu_kpa, ratio * _gland_mu(name)])
    assert (high >= low * (1.0 - 1e-12)).all()
    assert high[2] == pytest.approx(
        ratio / 3.0 * max(float(CATALOGUE[name].gland.law.tangent_kpa(e)) for e in (0, 0.4))
    )


def _gland_mu(name):
    return CATALOGUE[name].gland.law.mu_kpa


def test_homogeneous_tissue_needs_no_map_and_a_contrast_keeps_the_mean():
    plain = neo_hookean_tissue(9.4, 0.495)
    assert (float(plain.material.mu_kpa), plain.mu_kpa, plain.stiffness_ratio) == (9.4, 9.4, 1.0)
    told = neo_hookean_tissue(9.4, 0.495, 5.0, GLAND)
    assert told.material.mu_kpa.mean() == pytest.approx(9.4)
    assert told.material.mu_kpa[2] == pytest.approx(5.0 * told.material.mu_kpa[0])
    with pytest.raises(ValueError, match="share of gland"):
        neo_hookean_tissue(9.4, 0.495, 5.0)
    with pytest.raises(ValueError, match="share of gland"):
        catalogue_tissue("bakic", 0.495, None, 0.2)


@pytest.mark.parametrize(
    ("keys", "told"), [({}, True), ({"material": "homogeneous"}, False), ({"material": "lorenzen"}, True)]
)
def test_only_these_need_the_tissue_map(keys, told):
    assert BreastMechanics(**keys).tells_gland_from_fat is told
