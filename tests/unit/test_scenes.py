"""Synthetic breasts, their tissue, and checks of solver's answers from outside."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import place_breast
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.meshing.quality import scaled_jacobians
from mammoreg.meshing.trilinear import GAUSS_POINTS, volumes
from mammoreg.scenes.bodies import BODIES, body_mesh
from mammoreg.scenes.checks import outside_checks
from mammoreg.scenes.gland import HALF_AXES, gland_share
from mammoreg.scenes.inner_forces import InnerForces, least_corner_jacobian
from mammoreg.scenes.outer_forces import PlateFace, simpson_points
from mammoreg.scenes.scenario import LEVELS, Scenario
from mammoreg.scenes.scene import build_scene
from mammoreg.scenes.tissue import scene_tissue
from mammoreg.scenes.trial import Trial, try_scenario

EASY = Scenario("easy", "neo_hookean", 0.49, 0.35, 5, 10, "small", 0.4)


@pytest.mark.parametrize("name", BODIES)
def test_bodies_have_well_shaped_elements(name):
    mesh = body_mesh(name, 7)
    nodes = mesh.points[mesh.hexes()]
    assert scaled_jacobians(nodes, GAUSS_POINTS).min() > 0.3
    assert least_corner_jacobian(mesh.points, mesh.hexes()) > 0.1
    assert volumes(nodes).sum() == pytest.approx(
        volumes(body_mesh(name, 5).points[body_mesh(name, 5).hexes()]).sum(), rel=0.01
    )


@pytest.mark.parametrize("elements", LEVELS["elements"])
def test_gland_is_the_same_lens_on_every_mesh_and_leaves_room(elements):
    share = gland_share(elements)
    assert share.shape == (elements**3,)
    assert 0.0 <= share.min() < share.max() <= 1.0
    assert share.mean() == pytest.approx(gland_share(5).mean(), rel=0.05)
    layers = share.reshape((elements,) * 3).max(axis=(0, 2)) > 0.0
    assert layers.mean() <= 0.2 + 1e-9
    assert HALF_AXES[1] < 0.3


@pytest.mark.parametrize("material", LEVELS["material"])
def test_forces_from_the_energy_are_those_of_the_elements(material):
    mesh = body_mesh("small", 5)
    tissue = scene_tissue(material, 0.49, 10.0, 0.5, gland_share(5))
    model = HyperelasticModel(mesh.points, mesh.hexes(), tissue.material())
    rng = np.random.default_rng(3)
    positions = mesh.points * [1.2, 1.3, 0.7] + rng.normal(scale=0.3, size=mesh.points.shape)
    inner = InnerForces(mesh.points, mesh.hexes(), tissue)
    pressure = tissue.bulk_kpa * (inner.dilatation(positions) - 1.0)
    expected = model.residual(model.state(positions), pressure).force
    found = inner.element_forces(positions).reshape(len(expected), 24)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_distance_to_a_plate_with_a_lip():
    lower = PlateFace(10.0, 1, 0.0, 5.0)
    points = np.array([[0.0, -20.0, 12.0], [0.0, 3.0, 5.0], [0.0, 0.0, 10.0], [0.0, -9.0, 9.0]])
    np.testing.assert_allclose(lower.distance(points), [2.0, 3.0, 5.0 * np.sqrt(2.0) - 5.0, -1.0])
    np.testing.assert_allclose(lower.normal(points[:1]), [[0.0, 0.0, 1.0]], atol=1e-9)
    np.testing.assert_allclose(PlateFace(10.0, -1, 0.0, 5.0).distance(points[:1]), [-2.0])


def test_simpson_points_weigh_the_area():
    corners = np.array([[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.0]]])
    shape, area = simpson_points(corners)
    assert area.sum() == pytest.approx(6.0)
    np.testing.assert_allclose(shape.sum(axis=1), 1.0)


@pytest.fixture(scope="module")
def solved():
    scene = build_scene(EASY, body_mesh("small", 5))
    return scene, scene.closed()


def test_an_equilibrium_passes_every_check(solved):
    checks = outside_checks(*solved)
    assert [check.name for check in checks if not check.passed] == []
    assert {"unbalanced force", "volume change", "penetration over gap"} <= {check.name for check in checks}


def test_back_is_the_pipelines(solved):
    """Held towards the chest wall alone, sliding both ways across it, and pressed where it lies between the plates."""
    scene, _ = solved
    mesh, ours = body_mesh("small", 5), scene.back
    placed = place_breast(mesh, 0.0, BreastMechanics(fibre_ratio=0.0), 1.0, np.zeros(125))
    np.testing.assert_array_equal(ours.held, placed.back.held)
    np.testing.assert_allclose(ours.springs, placed.back.springs)
    np.testing.assert_array_equal(scene.contact_quads, placed.contact_quads)


def failed(scene, closed) -> set[str]:
    return {check.name for check in outside_checks(scene, closed) if not check.passed}


def test_what_is_no_equilibrium_fails(solved):
    scene, closed = solved
    moved = closed.deformed.copy()
    moved[len(moved) // 2] += [0.0, 0.0, 0.5]
    assert "unbalanced force" in failed(scene, replace(closed, deformed=moved))


def test_a_wrong_force_plate_or_pressure_fails(solved):
    scene, closed = solved
    lower, upper = closed.force_n
    assert failed(scene, replace(closed, force_n=(1.05 * lower, upper))) == {"reported plate force"}
    weaker = replace(closed.contact, pressure=closed.contact.pressure * np.array([1.0, 0.9])[:, None, None])
    wrong = failed(scene, replace(closed, contact=weaker))
    assert {"unbalanced force", "difference of the plates' forces"} <= wrong
    assert "load away from the plates" in failed(scene, replace(closed, height_mm=closed.height_mm - 20.0))


def test_a_body_that_swells_or_folds_fails(solved):
    scene, closed = solved
    assert "volume change" in failed(scene, replace(closed, deformed=1.3 * closed.deformed))
    folded = closed.deformed.copy()
    folded[scene.hexes[60, 0]] += 60.0
    assert "least det F at Gauss points, as its negative" in failed(scene, replace(closed, deformed=folded))


def test_a_trial_tells_what_came_of_it():
    trial = try_scenario(EASY, body_mesh("small", 5))
    assert (trial.converged, trial.checks_passed, trial.message) == (True, True, "")
    assert trial.force_n is not None
    assert trial.force_n > 0.0
    assert all(check["limit"] >= 0.0 for check in trial.values()["checks"])


def test_what_does_not_converge_is_told_with_its_reason():
    trial = try_scenario(replace(EASY, compression=-0.1), body_mesh("small", 5))
    assert (trial.converged, trial.checks_passed) == (False, None)
    assert "does not compress" in trial.message
    assert Trial(None, "not run").checks_passed is None
