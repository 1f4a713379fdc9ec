"""Catalogue, one-dimensional laws and the calibration of the homogeneous tissue."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.materials.catalogue import CATALOGUE, SKIN, CatalogueTissue
from mammoreg.materials.cube import SULLIVAN, cube_force_n, mu_for_force_kpa
from mammoreg.materials.elastic import bulk_ratio, neo_hookean
from mammoreg.materials.laws import Exponential, HardenedFat, Linear, NeoHookean
from stages.calibrate import stage as calibrate
from stages.engine.contract import Inputs, Subject
from tests.shared_data import DATA, requires_shared

REFERENCE = DATA / "reference/materials.json"
LAW_NAMES = {Exponential: "exponential", NeoHookean: "neo_hookean", Linear: "linear"}


@requires_shared("reference")
@pytest.mark.parametrize("model", list(CATALOGUE))
def test_constants_and_provenance_are_those_of_the_reference(model: str) -> None:
    reference = json.loads(REFERENCE.read_text())["models"][model]["tissues"]
    for name in ("fat", "gland"):
        tissue: CatalogueTissue = getattr(CATALOGUE[model], name)
        entry = reference.get(name, reference.get("all"))
        hardened = isinstance(tissue.law, HardenedFat)
        law = tissue.law.fat if isinstance(tissue.law, HardenedFat) else tissue.law
        assert LAW_NAMES[type(law)] == entry["law"]
        for constant, given_as in entry["constants"].items():
            scale = 1e-3 if constant.endswith("_pa") else 1.0
            own = constant.replace("_pa", "_kpa")
            assert getattr(law, own) == pytest.approx(given_as["value"] * scale)
            assert tissue.sources[f"fat.{own}" if hardened else own].provenance == given_as["provenance"]


def test_hardening_is_said_to_be_an_assumption_and_skin_is_the_papers() -> None:
    sources = CATALOGUE["azar"].fat.sources
    assert {sources[name].provenance for name in ("onset", "b_kpa", "m")} == {"assumption"}
    assert SKIN.law == Linear(10.0)
    assert SKIN.independent


@requires_shared("reference")
@pytest.mark.parametrize("model", [name for name in CATALOGUE if CATALOGUE[name].table_1])
def test_cube_forces_are_those_of_the_reference_and_of_table_1(model: str) -> None:
    reference = json.loads(REFERENCE.read_text())["models"][model]
    for name, compression, key in (("fat", 0.21, "fat_21"), ("gland", 0.50, "gland_50")):
        force = cube_force_n(getattr(CATALOGUE[model], name).law, compression)
        assert force == pytest.approx(reference["force_n"][key], abs=0.06)
        assert round(force) == pytest.approx(reference["table_1"][key], abs=1.0)
        assert CATALOGUE[model].table_1[name] == reference["table_1"][key]


@given(st.sampled_from([Exponential(4.46, 7.4), NeoHookean(9.4), Linear(48.0)]), st.floats(1e-5, 0.6))
def test_laws_stiffen_from_their_initial_modulus(law: Exponential | NeoHookean | Linear, compression: float) -> None:
    modulus = float(law.stress_kpa(1e-6)) * 1e6
    assert float(law.stress_kpa(compression)) >= modulus * compression * (1.0 - 1e-5)


def test_median_force_gives_the_paper_scale_and_no_scale_holds_both_ends() -> None:
    fields = calibrate.run(Inputs(), calibrate.Settings(), Subject("cohort"))
    values = fields.values
    assert values["mu_kpa"] == pytest.approx(9.40, abs=0.005)
    assert values["force_fat_21_n"] == pytest.approx(29.5, abs=0.05)
    assert values["force_gland_50_n"] == pytest.approx(127.0)
    assert (values["fat_21_in_range"], values["gland_50_in_range"]) == (False, True)
    assert values["force_ratio"] == pytest.approx(4.31, abs=0.005)
    assert values["range_ratio"] == pytest.approx(3.80, abs=0.005)
    assert values["any_scale_holds_both"] is False


def test_calibration_is_linear_in_the_force() -> None:
    assert mu_for_force_kpa(200.0, 0.3) == pytest.approx(2.0 * mu_for_force_kpa(100.0, 0.3))
    assert cube_force_n(NeoHookean(mu_for_force_kpa(77.0, 0.4)), 0.4) == pytest.approx(77.0)


def test_range_of_forces_ends_where_it_was_measured() -> None:
    assert [SULLIVAN.holds(force) for force in (48.9, 49.0, 186.0, 186.1)] == [False, True, True, False]


@pytest.mark.parametrize(("poisson", "ratio"), [(0.0, 2.0 / 3.0), (0.49, 49.6667), (0.499, 499.667)])
def test_bulk_ratio(poisson: float, ratio: float) -> None:
    assert bulk_ratio(poisson) == pytest.approx(ratio, rel=1e-5)


@pytest.mark.parametrize("poisson", [-0.1, 0.5, 0.7])
def test_impossible_poisson_ratios_are_refused(poisson: float) -> None:
    with pytest.raises(ValueError, match="Poisson"):
        bulk_ratio(poisson)


def test_material_spreads_over_elements_and_refuses_nonsense() -> None:
    material = neo_hookean(np.array([1.0, 2.0]), 0.49, fibre=np.array([0.0, 3.0, 4.0]), fibre_kpa=5.0).of_elements(2)
    assert material.fibres is not None
    np.testing.assert_allclose(material.fibres.direction, np.tile([0.0, 0.6, 0.8], (2, 1)))
    with pytest.raises(ValueError, match="positive"):
        neo_hookean(np.array([1.0, 0.0])).of_elements(2)
    with pytest.raises(ValueError, match="negative"):
        neo_hookean(1.0, fibre=np.array([1.0, 0.0, 0.0]), fibre_kpa=-1.0).of_elements(2)
