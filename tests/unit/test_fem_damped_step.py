"""The merit along which updates are searched."""

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import back_condition
from mammoreg.fem.parts.gravity import gravity
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.fem.plates.newton import DampedStep
from mammoreg.fem.plates.state import DampedState, Load
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block


@pytest.mark.parametrize("friction", [0.0, 0.3, float("inf")])
def test_gradient_of_the_merit_is_its_derivative(friction: float) -> None:
    mesh = block(3)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.499))
    back = back_condition("springs", mesh.points, mesh.back_quads())
    load = gravity(model, 1000.0, np.array([1.0, 0.0, 0.0]))
    closing = Closing(model, mesh.skin_quads(), back, friction=friction, parts=[load])
    state = closing.close(52.0).state
    equilibrium = closing.equilibrium()
    step = DampedStep(equilibrium, state, Load(closing.plates(51.0)), (*equilibrium.springs, load), 0.3)
    rng = np.random.default_rng(1)
    there = DampedState(
        state.positions + 0.3 * rng.normal(size=state.positions.shape), 0.8 * state.pressure, 0.1, state.memory
    )
    motion = rng.normal(size=equilibrium.total)
    h = 1e-4

    def merit(share: float) -> float:
        positions = there.positions + share * motion[:-1].reshape(-1, 3)
        return step._merit(positions, there.height + share * motion[-1], there.pressure)

    gradient = step._gradient(step._balance(there))
    assert gradient @ motion == pytest.approx((merit(h) - merit(-h)) / (2.0 * h), rel=1e-5)


def test_bodies_of_unlike_tissue_come_to_rest_where_newton_bounces() -> None:
    mesh = block(5, (60.0, 60.0, 50.0))
    stiff = (np.abs(mesh.points[mesh.hexes()].mean(axis=1)[:, 2]) < 9.0) * 999.0 + 1.0
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(stiff, 0.4999))
    back = back_condition("slide_compression", mesh.points, mesh.back_quads(), along_kpa_per_mm=0.1)
    closed = Closing(model, mesh.skin_quads(), back, friction=0.4, options=ClosingOptions(steps=5)).close(25.0)
    assert closed.report is not None
    assert closed.report.unbalance < 1e-3
    assert closed.force_n[0] == pytest.approx(closed.force_n[1], rel=1e-3)
    assert abs(closed.volume_change) < 0.01
