"""The paper's cube of 240 cm3: Table I, sliding faces against the closed form, glued ones against FEBio and FElupe."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import held_back
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.prescribed.cube import press_cube
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.catalogue import CATALOGUE, CatalogueTissue
from mammoreg.materials.cube import CUBE_MM3, HIGH_COMPRESSION, LOW_COMPRESSION, cube_force_n
from mammoreg.materials.elastic import bulk_ratio, hyperelastic, neo_hookean, tangent_bulk_kpa
from mammoreg.materials.laws import NeoHookean
from mammoreg.materials.mixture import TissueMixture
from tests.unit.fe_bodies import block

SIDE = CUBE_MM3 ** (1.0 / 3.0)


def uniaxial_force_n(mu_kpa: float, poisson: float, stretch: float) -> float:
    """Closed form: side faces free, isochoric split with K/2 (J - 1)^2."""
    bulk = mu_kpa * bulk_ratio(poisson)

    def lateral_stress(side: float) -> float:
        det = side**2 * stretch
        deviator = mu_kpa * det ** (-2.0 / 3.0) * (side**2 - (2.0 * side**2 + stretch**2) / 3.0)
        return float(deviator + bulk * (det - 1.0) * det)

    side = brentq(lateral_stress, 0.5, 3.0)
    det = side**2 * stretch
    deviator = mu_kpa * det ** (-2.0 / 3.0) * (stretch**2 - (2.0 * side**2 + stretch**2) / 3.0)
    return float(-(deviator + bulk * (det - 1.0) * det) / stretch * SIDE**2) * 1e-3


def squeezed_by_plates(poisson: float, friction: float, options: ClosingOptions) -> Closed:
    """The cube between plates, free to spread about its middle column."""
    mesh = block(4, (SIDE, SIDE, SIDE))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, poisson))
    column = np.flatnonzero((np.abs(mesh.points[:, :2]) < 1e-6).all(axis=1))
    side = np.flatnonzero((np.abs(mesh.points[:, 1]) < 1e-6) & (mesh.points[:, 0] > 0.49 * SIDE))
    nodes = np.concatenate([column, side])
    held = np.repeat([[True, True, False], [False, True, False]], [len(column), len(side)], axis=0)
    back = held_back(nodes, held)
    return Closing(model, mesh.skin_quads(), back, friction=friction, options=options).close(0.5 * SIDE)


@pytest.mark.parametrize(("poisson", "febio_n"), [(0.49, 134.404), (0.499, 135.093)])
def test_sliding_faces_give_the_closed_form(poisson: float, febio_n: float) -> None:
    expected = uniaxial_force_n(10.0, poisson, 0.5)
    assert expected == pytest.approx(febio_n, abs=0.001)
    closed = squeezed_by_plates(poisson, 0.0, ClosingOptions(penalty_per_mm=200.0, band_mm=0.02, contact_factors=()))
    assert closed.force_n == pytest.approx((expected, expected), rel=0.005)


def test_nearly_incompressible_closed_form_is_the_one_dimensional_law() -> None:
    assert uniaxial_force_n(10.0, 0.49999, 0.5) == pytest.approx(cube_force_n(NeoHookean(10.0), 0.5), rel=1e-4)


def glued_force_n(elements: int) -> float:
    """Force on the upper face when both keep their shape."""
    mesh = block(elements, (SIDE, SIDE, SIDE))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.49))
    faces = np.abs(mesh.points[:, 2]) > 0.499 * SIDE
    nodes = np.flatnonzero(faces & (mesh.points[:, 2] > 0.0))
    below = held_back(np.flatnonzero(faces & (mesh.points[:, 2] < 0.0)), np.ones(3, dtype=bool))
    result = solve_prescribed(model, nodes, mesh.points[nodes] - np.array([0.0, 0.0, 0.5 * SIDE]), below)
    return float(-result.reaction_n[2])


def test_glued_faces_give_the_force_of_other_programs() -> None:
    assert glued_force_n(7) == pytest.approx(153.890, abs=0.005)


def test_friction_spans_from_sliding_to_glued() -> None:
    options = ClosingOptions()
    sliding, rough, sticking = (squeezed_by_plates(0.49, friction, options) for friction in (0.0, 0.1, 2.0))
    assert sliding.force_n[0] < rough.force_n[0] < sticking.force_n[0] < glued_force_n(4)
    points = block(4, (SIDE, SIDE, SIDE)).points
    above = points[:, 2] > 0.499 * SIDE
    spread = [np.abs((closed.deformed - points)[above, :2]).max() for closed in (sliding, rough, sticking)]
    assert spread[0] == pytest.approx(0.5 * SIDE * (np.sqrt(2.0) - 1.0), abs=0.6)
    assert spread[2] < 0.3 * spread[0]


TABLE_1 = [
    pytest.param(getattr(model, tissue), compression, model.table_1.get(tissue), id=f"{name} {tissue}")
    for name, model in CATALOGUE.items()
    for tissue, compression in (("fat", LOW_COMPRESSION), ("gland", HIGH_COMPRESSION))
]


@pytest.mark.parametrize(("tissue", "compression", "paper_n"), TABLE_1)
def test_table_1_by_law_and_by_finite_elements(
    tissue: CatalogueTissue, compression: float, paper_n: float | None
) -> None:
    law = tissue.law
    expected = cube_force_n(law, compression)
    if paper_n is not None:
        assert round(expected) == paper_n
    bulk = tangent_bulk_kpa(law, compression, 0.499)
    once, twice = (press_cube(law, factor * bulk, compression, 2, "sliding").force_n for factor in (1.0, 2.0))
    assert once == pytest.approx(expected, rel=0.005)
    assert twice == pytest.approx(once, rel=5e-4)


def test_wellmans_gland_needs_a_bulk_modulus_tied_to_its_final_stiffness() -> None:
    """Tied to its initial shear modulus, as usual for nu = 0.499, the gland yields by its volume."""
    law = CATALOGUE["wellman"].gland.law
    pressed = press_cube(law, law.mu_kpa * bulk_ratio(0.499), 0.5, 2, "sliding")
    assert pressed.force_n < 0.95 * cube_force_n(law, 0.5)
    assert pressed.volume_change < -0.01
    enough = press_cube(law, 5000.0 * law.mu_kpa, 0.5, 2, "sliding")
    assert enough.force_n == pytest.approx(cube_force_n(law, 0.5), rel=0.01)


@pytest.mark.parametrize(("model", "tissue"), [("wellman", "gland"), ("bakic", "gland"), ("samani", "fat")])
def test_sliding_cube_is_homogeneous_on_any_mesh(model: str, tissue: str) -> None:
    law = getattr(CATALOGUE[model], tissue).law
    bulk = tangent_bulk_kpa(law, 0.5, 0.499)
    coarse, fine = (press_cube(law, bulk, 0.5, n, "sliding") for n in (1, 5))
    assert fine.force_n == pytest.approx(coarse.force_n, rel=1e-7)
    assert fine.energy_mj == pytest.approx(coarse.energy_mj, rel=1e-7)
    assert fine.min_det_f == pytest.approx(1.0 + coarse.volume_change, abs=1e-7)
    assert (fine.deformed.max(axis=0) - fine.deformed.min(axis=0))[0] == pytest.approx(SIDE * np.sqrt(2.0), rel=1e-3)


def test_sticking_cube_gives_the_force_of_other_programs() -> None:
    """FEBio, FElupe and a scikit-fem trial: 153.890 N (7 a side) for mu = 10 kPa, nu = 0.49."""
    pressed = press_cube(NeoHookean(10.0), 10.0 * bulk_ratio(0.49), 0.5, 7, "sticking")
    assert pressed.force_n == pytest.approx(153.890, abs=0.002)
    assert pressed.iterations < 60


@pytest.mark.parametrize("model", ["wellman", "bakic", "krouskop"])
def test_sticking_costs_force_and_stiff_laws_converge(model: str) -> None:
    law = CATALOGUE[model].gland.law
    bulk = tangent_bulk_kpa(law, 0.5, 0.499)
    sliding, sticking = (press_cube(law, bulk, 0.5, 4, faces) for faces in ("sliding", "sticking"))
    assert sliding.force_n < sticking.force_n
    assert sticking.min_det_f > 0.0
    assert abs(sticking.volume_change) < 2e-3


def test_cube_of_mixed_tissue_stores_the_mean_of_both_energies() -> None:
    fat, gland = CATALOGUE["wellman"].fat.law, CATALOGUE["krouskop"].gland.law
    mesh = block(2, (SIDE, SIDE, SIDE))
    material = hyperelastic(TissueMixture((fat, gland), np.full((8, 2), 0.5)), bulk_kpa=2e4)
    model = HyperelasticModel(mesh.points, mesh.hexes(), material)
    stretch = 0.7
    squeezed = mesh.points * np.array([stretch**-0.5, stretch**-0.5, stretch])
    expected = 0.5 * sum(float(law.energy_kpa(np.array(stretch**2 + 2.0 / stretch))) for law in (fat, gland))
    assert model.energy_mj(squeezed) == pytest.approx(expected * CUBE_MM3 * 1e-3)
