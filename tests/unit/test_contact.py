"""Plates, contact points, pressure and friction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, plate_pair, touching
from mammoreg.contact.surface import ContactSurface, Rule
from mammoreg.errors import DataError
from tests.unit.fe_bodies import block

Floats = NDArray[np.float64]
RULES: list[Rule] = ["nodes", "simpson", "gauss2", "gauss3"]
PLATES = (Plate(-24.0, 1, 5.0, 6.0), Plate(24.0, -1, 5.0, 6.0))


@given(
    st.floats(-40.0, 40.0), st.floats(-40.0, 40.0), st.floats(0.5, 15.0), st.sampled_from([1, -1]), st.floats(-30, 30)
)
def test_gradient_of_the_distance_is_the_normal(p: float, z: float, radius: float, facing: int, edge: float) -> None:
    plate = Plate(3.0, facing, edge, radius)
    point = np.array([[1.0, p, z]])
    gap = plate.gap(point)
    np.testing.assert_allclose(np.linalg.norm(gap.normal, axis=-1), 1.0)
    if gap.distance[0] < -0.4:  # inside, the distance has a ridge
        return
    step = 1e-6
    slopes = [(plate.gap(point + d).distance - plate.gap(point - d).distance)[0] / (2 * step) for d in step * np.eye(3)]
    np.testing.assert_allclose(slopes, gap.normal[0], atol=1e-4)


def test_curvature_of_the_lip_is_the_derivative_of_its_normal() -> None:
    plate = Plate(0.0, 1, 0.0, 5.0)
    point = np.array([[3.0, -2.0, -1.0]])
    step = 1e-6
    numeric = np.stack(
        [(plate.gap(point + d).normal - plate.gap(point - d).normal)[0] / (2 * step) for d in step * np.eye(3)], axis=1
    )
    np.testing.assert_allclose(plate.gap(point).hessian()[0], numeric, atol=1e-6)


def test_plate_without_end_is_a_plane() -> None:
    points = np.random.default_rng(0).uniform(-100.0, 100.0, (50, 3))
    np.testing.assert_allclose(Plate(7.0, 1).gap(points).distance, points[:, 2] - 7.0)
    np.testing.assert_allclose(Plate(7.0, -1).gap(points).distance, 7.0 - points[:, 2])


def test_tissue_behind_the_edge_is_free() -> None:
    behind = np.array([[0.0, 11.0, -50.0], [0.0, 30.0, 0.0]])
    assert (Plate(0.0, 1, 10.0, 5.0).gap(behind).distance > 0.0).all()


@pytest.mark.parametrize("facing", [1, -1])
def test_first_touch_touches_and_does_not_pass(facing: int) -> None:
    points = np.random.default_rng(1).uniform(-20.0, 20.0, (200, 3))
    height = Plate(0.0, facing, 4.0, 6.0).first_touch(points)
    distance = Plate(height, facing, 4.0, 6.0).gap(points).distance
    assert distance.min() == pytest.approx(0.0, abs=1e-9)


def test_plate_in_front_of_the_whole_body_is_refused() -> None:
    with pytest.raises(DataError, match="no point lies in front"):
        Plate(0.0, 1, -50.0, 5.0).first_touch(np.zeros((3, 3)))


@pytest.mark.parametrize("rule", RULES)
def test_areas_add_up_and_points_lie_on_the_faces(rule: Rule) -> None:
    mesh = block(3, (30.0, 60.0, 50.0))
    surface = ContactSurface(mesh.points, mesh.skin_quads(), rule)
    assert surface.area.sum() == pytest.approx(2 * 30 * 60 + 2 * 50 * 60 + 30 * 50)
    positions = surface.positions(mesh.points)
    on_face = np.isclose(np.abs(positions), [15.0, 30.0, 25.0]).any(axis=-1)
    assert on_face.all()
    np.testing.assert_allclose(surface.shape.sum(axis=1), 1.0)


def box_contact(friction: float = 0.0) -> tuple[SoftContact, Floats]:
    """A box that the plates of `PLATES` press by about 1 mm, a part of it behind their lips."""
    mesh = block(3, (60.0, 60.0, 50.0))
    return SoftContact(ContactSurface(mesh.points, mesh.skin_quads(), "gauss2"), 20.0, 0.5, friction), mesh.points


@pytest.mark.parametrize("friction", [0.0, 0.3, np.inf])
def test_contact_tangent_is_the_derivative_of_its_force(friction: float) -> None:
    contact, points = box_contact(friction)
    rng = np.random.default_rng(2)
    first = contact.terms(points, 0.0, PLATES, contact.start(points, PLATES, 0.0))
    memory = contact.remember(points, PLATES, 0.0, first, contact.start(points, PLATES, 0.0))
    nodes = points + rng.uniform(-0.8, 0.8, points.shape)
    direction, lift = rng.standard_normal(nodes.shape), 0.7
    faces = 3 * contact.surface.quads[:, :, None] + np.arange(3)
    moves = np.hstack([direction.ravel()[faces.reshape(len(faces), 12)], np.full((len(faces), 1), lift)])
    terms = contact.terms(nodes, 0.1, PLATES, memory)
    product = np.einsum("fij,fj->fi", terms.stiffness, moves)
    step = 1e-6
    plus = contact.terms(nodes + step * direction, 0.1 + step * lift, PLATES, memory).force
    minus = contact.terms(nodes - step * direction, 0.1 - step * lift, PLATES, memory).force
    np.testing.assert_allclose(product, (plus - minus) / (2 * step), rtol=1e-4, atol=1e-4 * np.abs(product).max())
    on_lip = np.abs(contact.surface.positions(nodes)[..., 1] - 2.0).min(axis=1) < 4.0
    assert np.abs(product[on_lip]).max() > 0.0
    assert np.abs(product[~on_lip]).max() > 0.0


@pytest.mark.parametrize("friction", [0.0, 0.3, np.inf])
def test_contact_force_is_the_gradient_of_its_energy(friction: float) -> None:
    contact, points = box_contact(friction)
    start = contact.start(points, PLATES, 0.0)
    memory = contact.remember(points, PLATES, 0.0, contact.terms(points, 0.0, PLATES, start), start)
    rng = np.random.default_rng(4)
    nodes, direction = points + rng.uniform(-0.8, 0.8, points.shape), rng.standard_normal(points.shape)
    lift, step = 0.7, 1e-5
    force = contact.terms(nodes, 0.1, PLATES, memory).force
    work = float(np.sum(force[:, :12].reshape(-1, 4, 3) * direction[contact.surface.quads]) + lift * force[:, 12].sum())
    plus = contact.energy_mj(nodes + step * direction, 0.1 + step * lift, PLATES, memory)
    minus = contact.energy_mj(nodes - step * direction, 0.1 - step * lift, PLATES, memory)
    assert 1e3 * (plus - minus) / (2 * step) == pytest.approx(work, rel=1e-5)


def test_shifts_press_as_hard_with_the_points_on_the_plates_face() -> None:
    contact, points = box_contact()
    plates = (Plate(-24.0, 1), Plate(24.0, -1))
    memory = contact.start(points, plates, 0.0)
    pressed = contact.terms(points, 0.0, plates, memory)
    assert pressed.penetration_mm == pytest.approx(1.0)
    flat = points * [1.0, 1.0, 24.0 / 25.0]
    augmented = contact.augmented(points, plates, 0.0, memory)
    there = contact.terms(flat, 0.0, plates, augmented)
    assert there.penetration_mm == pytest.approx(0.0, abs=1e-12)
    faces = (pressed.pressure.max(axis=0) > 0.0).all(axis=1)
    np.testing.assert_allclose(there.pressure[:, faces], pressed.pressure[:, faces])
    assert faces.any()


def test_friction_stays_in_its_cone_and_opposes_the_slip() -> None:
    contact, points = box_contact(0.25)
    plates = (Plate(-24.0, 1), Plate(24.0, -1))
    first = contact.terms(points, 0.0, plates, contact.start(points, plates, 0.0))
    memory = contact.remember(points, plates, 0.0, first, contact.start(points, plates, 0.0))
    touched = first.pressure > 0.0
    for slip, sliding in ((0.1, False), (5.0, True)):
        terms = contact.terms(points + np.array([slip, 0.0, 0.0]), 0.0, plates, memory)
        size, limit = np.linalg.norm(terms.traction, axis=-1)[touched], 0.25 * first.pressure[touched]
        assert (size <= limit * (1.0 + 1e-12)).all()
        assert np.isclose(size, limit).all() == sliding
        assert (terms.traction[touched][:, 0] < 0.0).all()


def test_pressure_is_smooth_and_stiff_below_its_band() -> None:
    contact, _ = box_contact()
    distance = np.linspace(-2.0, 1.0, 3001)
    pressure, slope = contact._barrier(distance)
    np.testing.assert_allclose(-np.gradient(pressure, distance)[1:-1], slope[1:-1], atol=0.05)
    assert (pressure[distance >= 0.5] == 0.0).all()
    np.testing.assert_allclose(pressure[distance <= -0.5], -20.0 * distance[distance <= -0.5])


def test_forces_of_contact_balance_the_height() -> None:
    contact, points = box_contact()
    memory = contact.start(points, PLATES, 0.0)
    terms = contact.terms(points, 0.0, PLATES, memory)
    assert terms.plate_force[0, 2] == pytest.approx(-terms.plate_force[1, 2])
    assert terms.force[:, 12].sum() == pytest.approx(0.0, abs=1e-9)
    raised = contact.terms(points, 0.2, PLATES, memory)
    assert raised.plate_force[:, 2].sum() > 0.0
    assert raised.force[:, 12].sum() == pytest.approx(raised.plate_force[:, 2].sum())


def test_plates_that_touch_press_nothing_yet() -> None:
    contact, points = box_contact()
    low, high = touching(contact.surface.positions(points).reshape(-1, 3), 5.0, 6.0)
    plates = plate_pair(high - low + 1.0, 0.5 * (low + high), 5.0, 6.0)
    assert contact.terms(points, 0.0, plates, contact.start(points, plates, 0.0)).penetration_mm == 0.0
    assert [plate.gap(contact.surface.positions(points)).distance.min() for plate in plates] == pytest.approx([0.5] * 2)
