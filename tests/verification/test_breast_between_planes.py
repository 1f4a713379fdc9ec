"""The half-ellipsoid breast between infinite planes against FEBio (design note on the solver)."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.shared_data import requires_shared
from tests.verification.febio import HEIGHT_MM, HalfEllipsoid, half_ellipsoid

pytestmark = requires_shared("fe")

UNDAMPED = ClosingOptions(damping=1e-9, rests=1, contact_factors=(), rule="nodes")
PRECISE = replace(UNDAMPED, steps=4, penalty_per_mm=100.0, band_mm=0.02)
LARGE_STEPS = replace(UNDAMPED, steps=2, penalty_per_mm=20.0, band_mm=0.1)


def close(body: HalfEllipsoid, percent: int, poisson: float, options: ClosingOptions, mu_kpa: float = 10.0) -> Closed:
    model = HyperelasticModel(body.points, body.hexes, neo_hookean(mu_kpa, poisson))
    return Closing(model, body.skin, body.held, options=options).close(HEIGHT_MM * (1.0 - 0.01 * percent))


@pytest.fixture(scope="module")
def body() -> HalfEllipsoid:
    return half_ellipsoid(7)


@pytest.mark.parametrize(("percent", "force_n"), [(21, 15.747), (50, 110.890)])
def test_displacements_and_forces_are_those_of_febio(body: HalfEllipsoid, percent: int, force_n: float) -> None:
    closed = close(body, percent, 0.49, PRECISE)
    difference = closed.deformed - body.points - body.displacement[percent]
    assert np.abs(difference).max() < 0.1
    assert closed.force_n == pytest.approx((force_n, force_n), rel=0.01)
    assert closed.penetration_mm < 0.1
    assert closed.height_mm == pytest.approx(-0.5 * closed.gap_mm, abs=0.02)


def test_twice_as_fine_mesh_is_that_of_febio() -> None:
    fine = half_ellipsoid(14)
    closed = close(fine, 21, 0.49, PRECISE)
    assert np.abs(closed.deformed - fine.points - fine.displacement[21]).max() < 0.1
    assert closed.force_n[0] == pytest.approx(15.748, rel=0.01)


@pytest.mark.parametrize(
    ("percent", "most", "low_n", "high_n"),
    [(21, 13, 15.6, 16.2), (50, 16, 109.0, 112.5), (60, 18, 200.0, 208.0), (70, 33, 390.0, 415.0)],
)
@pytest.mark.parametrize("poisson", [0.49, 0.499, 0.4999])
def test_two_load_steps_need_no_more_iterations_than_the_recipe(
    body: HalfEllipsoid, percent: int, most: int, low_n: float, high_n: float, poisson: float
) -> None:
    closed = close(body, percent, poisson, LARGE_STEPS)
    assert closed.iterations <= most
    assert low_n < closed.force_n[0] < high_n
    assert abs(closed.volume_change) < 5.0 * (0.5 - poisson)


def test_displacements_do_not_depend_on_stiffness(body: HalfEllipsoid) -> None:
    soft, stiff = (close(body, 21, 0.49, LARGE_STEPS, mu) for mu in (1.0, 50.0))
    np.testing.assert_allclose(stiff.deformed, soft.deformed, atol=1e-6)
    assert stiff.force_n[0] == pytest.approx(50.0 * soft.force_n[0], rel=1e-6)


def test_default_damping_ends_where_the_undamped_iteration_does(body: HalfEllipsoid) -> None:
    damped, plain = close(body, 50, 0.49, ClosingOptions(rule="nodes")), close(body, 50, 0.49, LARGE_STEPS)
    assert damped.iterations > plain.iterations
    assert np.abs(damped.deformed - plain.deformed).max() < 0.1


def test_prescribed_skin_of_a_compression_gives_its_interior(body: HalfEllipsoid) -> None:
    closed = close(body, 50, 0.49, PRECISE)
    model = HyperelasticModel(body.points, body.hexes, neo_hookean(10.0, 0.49))
    skin = np.unique(body.skin)
    again = solve_prescribed(model, skin, closed.deformed[skin], body.held)
    assert np.abs(again.deformed - closed.deformed).max() < 0.02
    assert again.energy_mj == pytest.approx(closed.energy_mj, rel=1e-3)
