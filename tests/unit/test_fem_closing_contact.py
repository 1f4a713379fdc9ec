"""What plates do to a block: augmentation, friction with known forces, sticking, one plate alone, stop at a force."""

import numpy as np
import pytest

from mammoreg.contact.soft import SoftContact
from mammoreg.contact.surface import ContactSurface
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, back_condition, held_back
from mammoreg.fem.parts.gravity import STANDARD_GRAVITY, gravity
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block

MESH = block(4)
MODEL = HyperelasticModel(MESH.points, MESH.hexes(), neo_hookean(10.0, 0.49))
BACK = back_condition("slide_compression", MESH.points, MESH.back_quads(), along_kpa_per_mm=0.1)


def test_augmentation_takes_penetration_back_with_the_same_penalty() -> None:
    options = {n: ClosingOptions(contact_factors=(), augmentations=n, penetration_mm=0.005) for n in (0, 8)}
    plain, augmented = (Closing(MODEL, MESH.skin_quads(), BACK, options=o).close(45.0) for o in options.values())
    assert augmented.penetration_mm < 0.005 < 0.3 < plain.penetration_mm
    assert augmented.iterations < 2 * plain.iterations
    hard = ClosingOptions(penalty_per_mm=200.0, band_mm=0.02, contact_factors=())
    expected = Closing(MODEL, MESH.skin_quads(), BACK, options=hard).close(45.0)
    np.testing.assert_allclose(augmented.deformed, expected.deformed, atol=0.1)
    assert augmented.force_n[0] == pytest.approx(expected.force_n[0], rel=0.01)


def pushed(share_of_limit: float) -> tuple[Closed, float, float]:
    """A block between plates pushed sideways by its weight; with the push and the springs' pull in the end, N."""
    spring, nodes = 20.0, MESH.back_nodes()
    springs = np.tile(spring * np.eye(3), (len(nodes), 1, 1))
    back = BackCondition(nodes, np.zeros((len(nodes), 3), dtype=bool), springs)
    options = ClosingOptions(slip_mm=0.05, tolerance_mm=0.002, rests=24)
    force_n = Closing(MODEL, MESH.skin_quads(), back, friction=0.2, options=options).close(57.0).force_n[0]
    push_n = share_of_limit * 2.0 * 0.2 * force_n
    density = push_n / (STANDARD_GRAVITY * 60.0**3 * 1e-9)
    load = gravity(MODEL, density, np.array([1.0, 0.0, 0.0]))
    closed = Closing(MODEL, MESH.skin_quads(), back, friction=0.2, options=options, parts=[load]).close(57.0)
    pull_n = 1e-3 * spring * float((closed.deformed - MESH.points)[nodes, 0].sum())
    return closed, push_n, pull_n


def test_block_pushed_below_the_friction_limit_sticks() -> None:
    closed, push_n, pull_n = pushed(0.6)
    assert np.mean(closed.deformed[:, 0] - MESH.points[:, 0]) < 0.6
    assert pull_n < 0.1 * push_n


def test_block_pushed_beyond_the_limit_slides_until_springs_hold_the_rest() -> None:
    closed, push_n, pull_n = pushed(1.6)
    assert np.mean(closed.deformed[:, 0] - MESH.points[:, 0]) > 3.0
    held_share = (push_n - pull_n) / (0.2 * sum(closed.force_n))
    # It came to a stop under the softer contact of the load steps, whose forces are some percent smaller.
    assert 0.85 < held_share < 1.005


def test_sticking_faces_are_glued() -> None:
    column = np.flatnonzero((np.abs(MESH.points[:, :2]) < 1e-6).all(axis=1))
    back = held_back(column[[2]], np.array([True, True, False]))
    held = ClosingOptions(penalty_per_mm=20.0, band_mm=0.1)
    closed = Closing(MODEL, MESH.skin_quads(), back, friction=float("inf"), options=held).close(45.0)
    faces = np.abs(MESH.points[:, 2]) > 29.9
    slip = (closed.deformed - MESH.points)[faces][:, :2]
    assert np.abs(slip - slip.mean(axis=0)).max() < 0.15
    nodes = np.flatnonzero(faces)
    squeezed = MESH.points[nodes] * [1.0, 1.0, 0.75]
    glued = solve_prescribed(MODEL, nodes, squeezed)
    top = np.flatnonzero(MESH.points[:, 2] > 29.9)
    below = held_back(np.flatnonzero(MESH.points[:, 2] < -29.9), np.ones(3, dtype=bool))
    force_n = -solve_prescribed(MODEL, top, MESH.points[top] - [0.0, 0.0, 15.0], below).reaction_n[2]
    assert closed.force_n[0] == pytest.approx(force_n, rel=0.02)
    np.testing.assert_allclose(closed.deformed - slip_shift(closed, faces), glued.deformed, atol=0.3)


def slip_shift(closed: Closed, faces: np.ndarray) -> np.ndarray:
    """Common motion (3,) of the faces."""
    return np.asarray((closed.deformed - MESH.points)[faces].mean(axis=0))


def test_one_plate_moving_is_both_moving_but_for_a_shift() -> None:
    back = back_condition("slide_compression", MESH.points, MESH.back_quads())
    both, upper, lower = (
        Closing(MODEL, MESH.skin_quads(), back, moving=moving).close(45.0) for moving in ("both", "upper", "lower")
    )
    assert upper.height_mm == -30.0
    assert lower.height_mm == pytest.approx(-15.0)
    for one in (upper, lower):
        shift = one.height_mm - both.height_mm
        np.testing.assert_allclose(one.deformed, both.deformed + np.array([0.0, 0.0, shift]), atol=0.01)
        assert one.force_n == pytest.approx(both.force_n, rel=1e-3)


def test_one_plate_moving_where_both_ends_are_known_is_refused() -> None:
    with pytest.raises(ValueError, match="moving must be"):
        Closing(MODEL, MESH.skin_quads(), BACK, lower_mm=-20.0, moving="upper")


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_plates_stop_at_a_force(friction: float) -> None:
    closing = Closing(MODEL, MESH.skin_quads(), BACK, friction=friction)
    at_gap = closing.close(42.0)
    at_force = closing.close_to_force(at_gap.force_n[0])
    assert np.mean(at_force.force_n) == pytest.approx(at_gap.force_n[0], rel=0.006)
    assert at_force.gap_mm == pytest.approx(42.0, abs=0.3)
    assert at_force.iterations < 3 * at_gap.iterations


def test_forces_beyond_reach_are_refused_with_a_reason() -> None:
    closing = Closing(MODEL, MESH.skin_quads(), BACK)
    with pytest.raises(NotConvergedError, match=r"is not reached: at a gap of .* the plates press with|came to"):
        closing.close_to_force(1e7)
    with pytest.raises(ValueError, match="must be positive"):
        closing.close_to_force(0.0)


def test_easy_steps_grow() -> None:
    few = Closing(MODEL, MESH.skin_quads(), BACK, options=ClosingOptions(easy_iterations=8)).close(45.0)
    many = Closing(MODEL, MESH.skin_quads(), BACK).close(45.0)
    assert few.steps < many.steps
    np.testing.assert_allclose(few.deformed, many.deformed, atol=0.01)


def test_bodies_without_plates_have_no_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("contact was evaluated")

    monkeypatch.setattr(SoftContact, "terms", refuse)
    monkeypatch.setattr(ContactSurface, "positions", refuse)
    nodes = MESH.back_nodes()
    report = solve_prescribed(MODEL, nodes, MESH.points[nodes] + 1.0).report
    assert report is not None
    assert report.plate_force_n is None
    assert "contact" not in report.seconds


def test_smooth_plates_remember_nothing_of_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("friction was evaluated")

    for name in ("_relative", "_friction", "_friction_energy", "_limit"):
        monkeypatch.setattr(SoftContact, name, refuse)
    memory = Closing(MODEL, MESH.skin_quads(), BACK).close(50.0).state.memory
    assert memory.anchor.size == memory.traction.size == memory.pressure.size == memory.shift.size == 0


def test_report_accounts_for_the_work_of_the_plates() -> None:
    options = ClosingOptions(penalty_per_mm=100.0, band_mm=0.05, contact_factors=())
    closing = Closing(MODEL, MESH.skin_quads(), BACK, options=options)
    results = [closing.close(gap) for gap in (46.0, 44.0)]
    work = 2.0 * float(np.mean([result.force_n for result in results]))
    reports = [result.report for result in results if result.report is not None]
    before, after = (r.isochoric_mj + r.volumetric_mj + sum(r.parts_mj.values()) for r in reports)
    assert after - before == pytest.approx(work, rel=0.01)
    report = reports[0]
    assert report.iterations == len(report.residuals) == results[0].iterations
    assert report.unbalance < 1e-3
    assert set(report.seconds) >= {"assembly", "contact", "linear", "other"}
    assert min(report.seconds.values()) >= 0.0
