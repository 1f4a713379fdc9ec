"""Incompressible membrane: closed forms, wrinkling, derivatives and invariances."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mammoreg.fem.skin.invariants import full_invariant, relaxed_invariant
from mammoreg.fem.skin.law import TensionLinear
from mammoreg.fem.skin.membrane import Membrane
from mammoreg.materials.neo_hookean import NeoHookean
from tests.unit.fe_bodies import block, rotation
from tests.unit.membranes import assembled, assert_energy_force_and_stiffness_agree, relaxed, sheet

LAWS = [NeoHookean(5.0), TensionLinear(10.0)]
THICKNESS = 1.4


def _stretched(points, first, second):
    return points * [first, second, 1.0]


def _edge_force(membrane, positions, edge, axis):
    return assembled(membrane, positions)[0].reshape(-1, 3)[edge, axis].sum()


@pytest.mark.parametrize("law", LAWS)
def test_patch_of_distorted_faces_keeps_a_homogeneous_stretch(law) -> None:
    points, quads = sheet(4, amount=0.25)
    membrane = Membrane(points, quads, law, THICKNESS)
    stretched = points @ np.array([[1.3, 0.1, 0.0], [0.05, 1.1, 0.0], [0.0, 0.0, 1.0]]) + [3.0, 1.0, 2.0]
    rim = (np.abs(points[:, :2] - 20.0) > 20.0 - 1e-9).any(axis=1)
    start = stretched.copy()
    start[~rim] += np.random.default_rng(2).normal(scale=0.3, size=(int((~rim).sum()), 3))
    free = np.repeat(~rim[:, None], 3, axis=1)
    found, _ = relaxed((membrane,), start, free, rounds=1)
    np.testing.assert_allclose(found, stretched, atol=1e-8)


@pytest.mark.parametrize("stretch", [1.05, 1.4, 1.8])
@pytest.mark.parametrize("share", [0.0, 0.01, 1.0])
def test_uniaxial_tension_in_closed_form(stretch, share) -> None:
    points, quads = sheet(3)
    law = TensionLinear(10.0)
    membrane = Membrane(points, quads, law, THICKNESS, share)
    positions = _stretched(points, stretch, stretch**-0.5)
    right = points[:, 0] > 40.0 - 1e-9
    assert _edge_force(membrane, positions, right, 0) == pytest.approx(10.0 * (stretch - 1.0) * THICKNESS * 40.0)
    assert _edge_force(membrane, positions, points[:, 1] > 40.0 - 1e-9, 1) == pytest.approx(0.0, abs=1e-6)
    assert membrane.energy_mj(positions) == pytest.approx(0.5e-3 * 10.0 * (stretch - 1.0) ** 2 * THICKNESS * 1600.0)


@pytest.mark.parametrize("stretch", [1.02, 1.3])
def test_equibiaxial_tension_in_closed_form(stretch) -> None:
    points, quads = sheet(3, amount=0.2)
    mu = 4.0
    membrane = Membrane(points, quads, NeoHookean(mu), THICKNESS)
    nominal = mu * (stretch - stretch**-5)
    force = _edge_force(membrane, _stretched(points, stretch, stretch), points[:, 0] > 40.0 - 1e-9, 0)
    assert force == pytest.approx(nominal * THICKNESS * 40.0)


@pytest.mark.parametrize("law", LAWS)
def test_balloon_pressure_over_its_stretch(law) -> None:
    mesh = block(12, (1.0, 1.0, 1.0))
    quads = np.concatenate([mesh.skin_quads(), mesh.back_quads()])
    radius, stretch = 50.0, 1.25
    size = np.linalg.norm(mesh.points, axis=1, keepdims=True)
    points = radius * mesh.points / np.where(size > 0.0, size, 1.0)
    membrane = Membrane(points, quads, law, THICKNESS)
    force = assembled(membrane, stretch * points)[0].reshape(-1, 3)
    # Plane-stress Cauchy stress, thickness and curvature of the blown sphere: p = 2 sigma h / r.
    invariant = np.array(2.0 * stretch**2 + stretch**-4)
    cauchy = 2.0 * float(law.slope_kpa(invariant)) * (stretch**2 - stretch**-4)
    pressure = 2.0 * cauchy * THICKNESS / stretch**2 / (radius * stretch)
    outward = float((force * points / radius).sum())
    area = 4.0 * np.pi * (radius * stretch) ** 2
    assert outward / area == pytest.approx(pressure, rel=0.01)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-8)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("share", [0.0, 0.01, 1.0])
def test_stiffness_and_force_are_derivatives_of_the_energy(law, share) -> None:
    points, quads = sheet(3, amount=0.2)
    membrane = Membrane(points, quads, law, THICKNESS, share)
    rng = np.random.default_rng(5)
    for linear in ([1.4, 1.2, 1.0], [1.5, 0.6, 1.0]):
        positions = points * linear + rng.normal(scale=0.4, size=points.shape)
        assert_energy_force_and_stiffness_agree(membrane, positions, 2e-5)


def test_derivatives_of_the_invariants() -> None:
    gradients = np.random.default_rng(1).normal(size=(200, 3, 2))
    stretch = np.einsum("nia,nib->nab", gradients, gradients)[:, [0, 1, 0], [0, 1, 1]]
    step = 1e-6
    for invariant in (full_invariant, relaxed_invariant):
        stretch = stretch[np.abs(full_invariant(stretch).value) < 50.0]
        at = invariant(stretch)
        for axis, length in enumerate((2.0, 2.0, 1.0)):
            change = step * length * np.eye(3)[axis]
            ahead, behind = invariant(stretch + change), invariant(stretch - change)
            scale = 1.0 + np.abs(at.hessian).max()
            slope, bend = (ahead.value - behind.value) / (2 * step), (ahead.gradient - behind.gradient) / (2 * step)
            np.testing.assert_allclose(slope, at.gradient[:, axis], atol=1e-8 * scale)
            np.testing.assert_allclose(bend, at.hessian[:, axis], atol=1e-6 * scale)


@given(first=st.floats(0.3, 2.0), second=st.floats(0.3, 2.0), angle=st.floats(0.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_relaxed_invariant_is_the_smallest_over_narrower_widths(first, second, angle) -> None:
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    tensor = turn @ np.diag([first**2, second**2]) @ turn.T
    value = float(relaxed_invariant(tensor[[0, 1, 0], [0, 1, 1]]).value)
    # Wrinkles shorten a fibre at no cost: the membrane may be anything wider than what is seen.
    wide = np.linspace(0.0, 2.5, 251)
    one, two = np.meshgrid(first + wide, second + wide)
    least = (one**2 + two**2 + (one * two) ** -2.0).min()
    assert value == pytest.approx(least, abs=2e-3)
    assert value <= first**2 + second**2 + (first * second) ** -2.0 + 1e-12


def test_rigid_motion_costs_nothing_and_turns_the_force() -> None:
    points, quads = sheet(3, amount=0.2)
    membrane = Membrane(points, quads, TensionLinear(10.0), THICKNESS)
    turn = rotation((1.0, -2.0, 0.5), 1.1)
    residual, _ = assembled(membrane, points @ turn.T + [5.0, -3.0, 2.0])
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)
    positions = _stretched(points, 1.3, 0.8)
    before, after = (assembled(membrane, p)[0].reshape(-1, 3) for p in (positions, positions @ turn.T))
    np.testing.assert_allclose(after, before @ turn.T, atol=1e-9)
    assert membrane.energy_mj(positions) == pytest.approx(membrane.energy_mj(positions @ turn.T))


def test_compression_meets_a_hundredth_of_the_resistance_of_an_unrelaxed_membrane() -> None:
    points, quads = sheet(2)
    shrunk = _stretched(points, 0.7, 0.7)
    whole = Membrane(points, quads, NeoHookean(4.0), THICKNESS, 1.0)
    field = Membrane(points, quads, NeoHookean(4.0), THICKNESS, 0.0)
    usual = Membrane(points, quads, NeoHookean(4.0), THICKNESS)
    assert field.energy_mj(shrunk) == 0.0
    assert not assembled(field, shrunk)[0].any()
    np.testing.assert_allclose(assembled(usual, shrunk)[0], 0.01 * assembled(whole, shrunk)[0], atol=1e-12)


def test_wrinkled_tension_field_has_no_negative_stiffness() -> None:
    points, quads = sheet(3, amount=0.1)
    membrane = Membrane(points, quads, NeoHookean(4.0), THICKNESS, 0.0)
    positions = _stretched(points, 1.4, 0.6)
    positions[:, 2] += np.random.default_rng(4).normal(scale=0.5, size=len(points))
    values = np.linalg.eigvalsh(assembled(membrane, positions)[1])
    assert values.min() > -1e-9 * values.max()


def test_twice_the_thickness_doubles_force_and_stiffness() -> None:
    points, quads = sheet(2)
    positions = _stretched(points, 1.2, 1.1)
    thin, thick = (Membrane(points, quads, NeoHookean(4.0), h) for h in (0.7, 1.4))
    for one, two in zip(thin.terms(positions), thick.terms(positions), strict=True):
        np.testing.assert_allclose(2.0 * one, two)


def test_skin_law_is_linear_in_tension_and_consistent() -> None:
    law, stretch = TensionLinear(10.0), np.linspace(1.001, 1.6, 50)
    i1 = stretch**2 + 2.0 / stretch
    np.testing.assert_allclose(2.0 * law.slope_kpa(i1) * (stretch - stretch**-2), 10.0 * (stretch - 1.0), rtol=1e-6)
    step = 1e-6
    slope = (law.energy_kpa(i1 + step) - law.energy_kpa(i1 - step)) / (2.0 * step)
    bend = (law.slope_kpa(i1 + step) - law.slope_kpa(i1 - step)) / (2.0 * step)
    np.testing.assert_allclose(slope[5:], law.slope_kpa(i1)[5:], rtol=1e-4)
    np.testing.assert_allclose(bend[5:], law.curvature_kpa(i1)[5:], rtol=1e-4)
    assert law.mu_kpa == pytest.approx(2.0 * float(law.slope_kpa(np.array(3.0))), rel=1e-6)
    assert np.isfinite(law.curvature_kpa(np.array([3.0, 2.9999999]))).all()
