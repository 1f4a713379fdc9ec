"""Isochoric laws: one-dimensional law, derivatives, and whether they are well posed, for every law of the catalogue."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from mammoreg.materials.catalogue import CATALOGUE, SKIN
from mammoreg.materials.laws import Exponential, HardenedFat, Law, Linear, NeoHookean, Tabulated
from mammoreg.materials.uniaxial import simple_shear, uniaxial_compression

Floats = NDArray[np.float64]
TABLE = Tabulated((0.1, 0.2, 0.3, 0.4, 0.5, 0.55), (1.0, 2.5, 4.5, 7.5, 12.0, 15.0))
LAWS: dict[str, Law] = {
    f"{name} {tissue}": getattr(model, tissue).law for name, model in CATALOGUE.items() for tissue in ("fat", "gland")
} | {"skin": SKIN.law, "table": TABLE}
PAPER_COMPRESSION = 0.5

every_law = pytest.mark.parametrize("law", list(LAWS.values()), ids=list(LAWS))


def i1_of(compression: Floats) -> Floats:
    stretch = 1.0 - compression
    return np.asarray(stretch**2 + 2.0 / stretch)


@every_law
def test_uniaxial_compression_has_the_stress_of_the_one_dimensional_law(law: Law) -> None:
    compression = np.array([1e-6, 1e-3, 0.05, 0.21, 0.35, 0.48])
    stretch = 1.0 - compression
    stress = 2.0 * law.slope_kpa(i1_of(compression)) * (stretch**-2 - stretch)
    np.testing.assert_allclose(stress, law.stress_kpa(compression), rtol=1e-9)
    at_half = 2.0 * law.slope_kpa(i1_of(np.array(PAPER_COMPRESSION))) * 3.5
    assert at_half == pytest.approx(float(law.stress_kpa(PAPER_COMPRESSION)), rel=0.002)


@every_law
def test_energy_is_the_work_of_the_one_dimensional_law(law: Law) -> None:
    compression = np.linspace(0.0, 0.48, 4801)
    work = np.trapezoid(law.stress_kpa(compression), compression)
    assert float(law.energy_kpa(i1_of(np.array(0.48)))) == pytest.approx(work, rel=1e-6)
    assert float(law.energy_kpa(np.array(3.0))) == 0.0


@every_law
@pytest.mark.parametrize("i1", [3.0002, 3.05, 3.2, 3.9, 4.15, 4.6, 5.7, 8.0, 40.0])
def test_slope_and_curvature_are_derivatives_of_the_energy(law: Law, i1: float) -> None:
    step = 1e-4 * (i1 - 3.0)
    around = np.array([i1 - step, i1 + step])
    slope, curvature = float(law.slope_kpa(np.array(i1))), float(law.curvature_kpa(np.array(i1)))
    assert np.diff(law.energy_kpa(around))[0] / (2 * step) == pytest.approx(slope, rel=1e-6)
    assert np.diff(law.slope_kpa(around))[0] / (2 * step) == pytest.approx(curvature, rel=1e-5, abs=1e-9 * law.mu_kpa)


@every_law
def test_initial_shear_modulus_is_a_third_of_the_initial_tangent(law: Law) -> None:
    assert law.mu_kpa == pytest.approx(float(law.tangent_kpa(0.0)) / 3.0)
    assert 2.0 * float(law.slope_kpa(np.array(3.0))) == pytest.approx(law.mu_kpa)
    assert np.isfinite(law.curvature_kpa(np.array([3.0, 3.0 - 1e-15, 3.0 + 1e-15]))).all()


@every_law
def test_tangent_in_compression_is_the_derivative_of_the_stress(law: Law) -> None:
    compression, step = np.array([0.05, 0.2, 0.33, 0.47]), 1e-6
    slope = (law.stress_kpa(compression + step) - law.stress_kpa(compression - step)) / (2 * step)
    np.testing.assert_allclose(law.tangent_kpa(compression), slope, rtol=1e-6)


@every_law
def test_shear_stress_grows_without_end(law: Law) -> None:
    shear = np.linspace(0.0, 6.0, 6001)
    stress = 2.0 * shear * law.slope_kpa(3.0 + shear**2)
    assert np.diff(stress).min() / np.diff(shear)[0] > 0.019 * law.mu_kpa


def bounded(shape: tuple[int, ...]) -> st.SearchStrategy[Floats]:
    return arrays(np.float64, shape, elements=st.floats(-1.0, 1.0, allow_subnormal=False))


def compressed_to(gradient: Floats, most: float) -> Floats:
    """The deformation brought to det F = 1, and towards rigid until its I1 is at most that of a compression."""
    left, stretches, right = np.linalg.svd(gradient)
    logs = np.log(stretches) - np.log(stretches).mean()
    while (np.exp(2.0 * logs)).sum() > float(i1_of(np.array(most))):
        logs *= 0.9
    return np.asarray((left * np.exp(logs)) @ right)


@given(bounded((3, 3)), bounded((3,)), bounded((3,)), st.sampled_from(list(LAWS.values())))
def test_legendre_hadamard_holds_up_to_the_papers_compression(
    gradient: Floats, normal: Floats, across: Floats, law: Law
) -> None:
    """The energy is convex along every isochoric rank-one change of any isochoric deformation: finite differences."""
    if abs(np.linalg.det(np.eye(3) + gradient)) < 1e-2 or np.linalg.norm(normal) < 0.1:
        return
    deformation = compressed_to(np.eye(3) + gradient, PAPER_COMPRESSION)
    spatial = np.linalg.solve(deformation.T, normal)
    along = across - spatial * (across @ spatial) / (spatial @ spatial)
    if np.linalg.norm(along) < 0.1:
        return
    change = np.outer(along, normal) / np.linalg.norm(along) / np.linalg.norm(normal)
    step = 1e-3
    i1 = np.array([((deformation + t * step * change) ** 2).sum() for t in (-1.0, 0.0, 1.0)])
    before, at, after = law.energy_kpa(i1)
    assert before - 2.0 * at + after > -1e-9 * law.mu_kpa


def test_sharpest_case_of_that_condition_is_simple_shear() -> None:
    """A linear law followed exactly to 60 % would fail it, which is why it is not."""
    shear = simple_shear(np.array([0.49, 0.55]))
    np.testing.assert_allclose(uniaxial_compression(3.0 + shear**2), [0.49, 0.55], rtol=1e-12)
    exact = np.array([0.49 / (0.51**-2 - 0.51), 0.55 / (0.45**-2 - 0.45)]) * shear
    assert exact[1] < exact[0]
    assert Linear(48.0).exact_to == pytest.approx(0.4814, abs=1e-4)
    assert {law.exact_to for law in LAWS.values() if isinstance(law, Exponential | HardenedFat)} == {0.6}


@given(st.floats(1e-7, 0.97))
def test_root_of_the_cubic(compression: float) -> None:
    found = float(uniaxial_compression(i1_of(np.array(compression))))
    # I1 - 3 is about 3 e^2, so that rounding I1 costs digits of small compressions.
    assert found == pytest.approx(compression, rel=1e-12, abs=1e-15 / compression)


def test_table_of_a_law_gives_that_law() -> None:
    law = Exponential(4.46, 7.4)
    rows = np.linspace(0.01, 0.6, 60)
    table = Tabulated(tuple(rows), tuple(law.stress_kpa(rows)))
    i1 = np.linspace(3.01, 5.0, 50)
    np.testing.assert_allclose(table.slope_kpa(i1), law.slope_kpa(i1), rtol=1e-3)
    np.testing.assert_allclose(table.energy_kpa(i1), law.energy_kpa(i1), rtol=1e-3)


@pytest.mark.parametrize(
    ("compressions", "stresses", "message"),
    [
        ((0.2,), (1.0,), "two rows"),
        ((0.1, 0.2), (1.0,), "two rows"),
        ((0.1, 0.3, 0.2), (1.0, 2.0, 3.0), "row 3"),
        ((0.1, 0.2), (1.0, 1.0), "row 2"),
        ((-0.1, 0.2), (1.0, 2.0), "row 1"),
        ((0.1, 1.2), (1.0, 2.0), "below 1"),
        ((0.1, float("nan")), (1.0, 2.0), "row 2"),
    ],
)
def test_impossible_tables_are_refused(
    compressions: tuple[float, ...], stresses: tuple[float, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Tabulated(compressions, stresses)


def test_ligaments_act_from_their_onset_on_and_are_bounded() -> None:
    fat, gland = Exponential(4.46, 7.4), Exponential(15.1, 12.3)
    hardened = HardenedFat(fat, gland, onset=0.21, b_kpa=4.46, m=12.3)
    below, above = np.linspace(0.0, 0.21, 22), np.linspace(0.22, 0.6, 20)
    np.testing.assert_array_equal(hardened.stress_kpa(below), fat.stress_kpa(below))
    assert (hardened.stress_kpa(above) > fat.stress_kpa(above)).all()
    assert (hardened.tangent_kpa(above) < gland.tangent_kpa(above)).all()
    with pytest.raises(ValueError, match="21%"):
        HardenedFat(fat, gland, onset=0.1, b_kpa=4.46, m=12.3)
    with pytest.raises(ValueError, match="stiffer than gland"):
        HardenedFat(fat, gland, onset=0.21, b_kpa=400.0, m=12.3)


def test_neo_hookean_has_no_curvature_and_its_table_has_hardly_any() -> None:
    law = NeoHookean(9.4)
    rows = np.linspace(0.005, 0.6, 120)
    table = Tabulated(tuple(rows), tuple(law.stress_kpa(rows)))
    i1 = np.linspace(3.1, 5.0, 20)
    assert not law.curvature_kpa(i1).any()
    np.testing.assert_allclose(table.slope_kpa(i1), 4.7, rtol=1e-4)
