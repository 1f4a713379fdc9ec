"""Gravity: the whole weight, a hydrostatic column, a hanging body."""

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import held_back
from mammoreg.fem.parts.gravity import STANDARD_GRAVITY, gravity
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block, distorted

DOWN = np.array([0.0, 0.0, -2.0])


@pytest.mark.parametrize("density", [950.0, "by element"])
def test_forces_add_up_to_the_weight(density: float | str) -> None:
    mesh = distorted(4)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0))
    kg_m3 = np.linspace(500.0, 1500.0, 64) if density == "by element" else float(density)
    force = gravity(model, kg_m3, DOWN).force.sum(axis=0)
    weight_mn = float(np.sum(kg_m3 * model.volume)) * 1e-9 * STANDARD_GRAVITY * 1e3
    np.testing.assert_allclose(force, [0.0, 0.0, -weight_mn], atol=1e-9 * weight_mn)


def test_column_between_rollers_bears_the_hydrostatic_pressure() -> None:
    mesh = block(4, (30.0, 30.0, 60.0))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.4999))
    rollers = held_back(np.arange(len(mesh.points)), np.array([True, True, False]))
    bottom = np.flatnonzero(mesh.points[:, 2] < -29.9)
    result = solve_prescribed(model, bottom, mesh.points[bottom], rollers, parts=[gravity(model, 1000.0, DOWN)])
    depth = 30.0 - mesh.points[mesh.hexes()].mean(axis=1)[:, 2]
    np.testing.assert_allclose(result.pressure, -1e-6 * 1000.0 * STANDARD_GRAVITY * depth, rtol=2e-3)
    weight_n = 1000.0 * STANDARD_GRAVITY * 30.0 * 30.0 * 60.0 * 1e-9
    assert result.reaction_n[2] == pytest.approx(weight_n, rel=1e-4)


def test_hanging_body_grows_longer_and_loses_potential() -> None:
    mesh = block(4)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(0.5, 0.49))
    back = mesh.back_nodes()
    load = gravity(model, 1000.0, np.array([0.0, -1.0, 0.0]))
    result = solve_prescribed(model, back, mesh.points[back], parts=[load])
    assert np.ptp(result.deformed[:, 1]) > 1.03 * np.ptp(mesh.points[:, 1])
    assert result.report is not None
    # At rest of a nearly linear body the load has done twice the work that is stored.
    stored = result.report.isochoric_mj + result.report.volumetric_mj
    assert -result.report.parts_mj["Gravity"] == pytest.approx(2.0 * stored, rel=0.1)


def test_loads_without_a_way_to_fall_are_refused() -> None:
    mesh = block(2)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0))
    with pytest.raises(ValueError, match="no length"):
        gravity(model, 1000.0, np.zeros(3))
    with pytest.raises(ValueError, match="negative"):
        gravity(model, -1.0, DOWN)
