"""Mechanics of digital patients."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.contact.plate import Plate
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.materials.elastic import neo_hookean
from mammoreg.phantom import patient as drawing
from mammoreg.phantom.barrier import barrier_force, barrier_stiffness
from mammoreg.phantom.compression import Press
from mammoreg.phantom.mechanics import element_moduli, wall_springs
from mammoreg.phantom.mesh import breast_mesh
from mammoreg.phantom.patient import Patient
from mammoreg.phantom.touch import ROPE_MM, Grip, SkinNodes


@pytest.fixture(scope="module")
def patient():
    return Patient.draw(12, ("CC",), healthy=False, landmarks=5)


@pytest.fixture(scope="module")
def coarse(patient):
    return breast_mesh(patient.shape, core=4, rows=5, shells=1)


def plates():
    return Plate(-10.0, 1, 0.0, 8.0), Plate(10.0, -1, 0.0, 8.0)


def test_contact_stiffness_is_the_slope_of_its_force():
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-20, 20, 40), rng.uniform(-40, -9, 40), rng.choice([-9.9, -10.1, 10.05], 40)])
    skin = SkinNodes(np.arange(40), rng.uniform(10, 30, 40))
    grip = Grip(rng.uniform(0, 2, (2, 40)), places + rng.normal(0, 0.3, (2, *places.shape)))

    def force(x):
        return skin.touch(x, grip, plates(), 5.0).force

    step = 1e-6
    slope = np.stack([(force(places + step * e) - force(places - step * e)) / (2 * step) for e in np.eye(3)], axis=-1)
    np.testing.assert_allclose(-skin.touch(places, grip, plates(), 5.0).stiffness, slope, rtol=1e-3, atol=1e-2)


def test_friction_opposes_the_slip_and_stays_below_its_limit():
    places = np.array([[5.0, -30.0, -10.2]])
    skin = SkinNodes(np.array([0]), np.array([20.0]))
    limit = np.array([[0.8], [0.0]])
    slid = skin.touch(places, Grip(limit, np.stack([places - [3.0, 0.0, 0.0]] * 2)), plates(), 5.0)
    stuck = skin.touch(places, Grip(limit, np.stack([places] * 2)), plates(), 5.0)
    assert slid.force[0, 0] == pytest.approx(-0.8 * 20.0, rel=1e-3)
    assert stuck.force[0, 0] == 0.0
    assert slid.force[0, 2] == stuck.force[0, 2] > 0.0


def test_friction_stays_while_the_skin_rests_and_ends_with_the_contact():
    places = np.array([[5.0, -30.0, -10.2], [9.0, -30.0, -2.0]])
    pressure = np.array([[2.0, 0.0], [0.0, 0.0]])
    moved = places + np.array([2.0, 0.0, 0.0])
    slid = Grip.none(places).renewed(pressure, places, 0.3).renewed(pressure, moved, 0.3)
    np.testing.assert_allclose(slid.renewed(pressure, moved, 0.3).anchor, slid.anchor)
    assert np.linalg.norm(moved[0] - slid.anchor[0, 0]) == pytest.approx(ROPE_MM)
    np.testing.assert_allclose(slid.anchor[:, 1], moved[[1, 1]])
    np.testing.assert_allclose(slid.limit, 0.3 * pressure)


def test_the_barrier_is_the_slope_of_its_energy():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    points = 8.0 * np.concatenate([points, points + np.array([0.0, 0.0, 1.0])])
    model = HyperelasticModel(points, np.arange(8)[None], neo_hookean(1.0))
    places = points + np.random.default_rng(3).normal(0.0, 0.8, points.shape)
    kappa = np.array([2.0])

    def energy(x):
        det = model.determinants(x.reshape(8, 3))
        return float((model.weights * kappa[:, None] * (det - 1.0 - np.log(det))).sum())

    def force(x):
        return barrier_force(model.state(x.reshape(8, 3)), model.weights, kappa)[0].copy()

    flat, step = places.ravel(), 1e-5
    ends = [(flat + step * e, flat - step * e) for e in np.eye(24)]
    slope = [(energy(a) - energy(b)) / (2 * step) for a, b in ends]
    np.testing.assert_allclose(force(flat), slope, rtol=1e-5, atol=1e-5)
    stiffness = np.stack([(force(a) - force(b)) / (2 * step) for a, b in ends], axis=-1)
    found = barrier_stiffness(model.state(places), model.weights, kappa)[0]
    np.testing.assert_allclose(found, stiffness, rtol=1e-5, atol=1e-4)


def test_gland_lesion_and_skin_stiffen(patient, coarse):
    soft = replace(patient.mechanics, gland_ratio=1.0, lesion_ratio=1.0, skin_ratio=1.0)
    np.testing.assert_allclose(element_moduli(patient.anatomy, coarse, soft), soft.fat_kpa)
    moduli = element_moduli(patient.anatomy, coarse, patient.mechanics)
    assert moduli.min() >= patient.mechanics.fat_kpa * 0.999
    assert moduli.max() > 2.0 * patient.mechanics.fat_kpa


def test_the_wall_resists_a_push_with_its_stiffness_times_its_area(patient, coarse):
    springs = wall_springs(
        coarse.points, coarse, replace(patient.mechanics, wall_normal_kpa_per_mm=2.0, wall_tangential_kpa_per_mm=2.0)
    )
    faces = coarse.points[coarse.back_quads]
    area = 0.5 * np.linalg.norm(np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1]), axis=1).sum()
    assert np.trace(springs, axis1=1, axis2=2).sum() / 3.0 == pytest.approx(2.0 * area, rel=0.05)


def test_a_pressed_breast_lies_between_the_plates_and_keeps_its_volume(patient, coarse):
    placement = replace(patient.placements["CC"], share=0.45)
    press = Press(patient.anatomy, coarse, patient.mechanics, placement)
    found = press.close()
    front = found.deformed[found.deformed[:, 1] < placement.edge_p_mm - 20.0]
    assert front[:, 2].min() > found.height_mm - 0.6
    assert front[:, 2].max() < found.height_mm + found.gap_mm + 0.6
    assert found.gap_mm == pytest.approx(0.55 * found.uncompressed_mm)
    assert abs(found.volume_change) < 0.015
    assert found.min_det_f > 0.1
    assert found.penetration_mm < 1.5
    assert found.force_n > 10.0
    again = Press(patient.anatomy, coarse, patient.mechanics, placement).close()
    assert np.array_equal(again.deformed, found.deformed)


def test_fibres_turn_the_breasts_elongation_sideways(patient, coarse):
    placement = replace(patient.placements["CC"], share=0.35)

    def sizes(ratio):
        mechanics = replace(patient.mechanics, fibre_ratio=ratio)
        nodes = Press(patient.anatomy, coarse, mechanics, placement).close().deformed
        return np.ptp(nodes[nodes[:, 1] < placement.edge_p_mm, 0]), -nodes[:, 1].min()

    soft, stiff = sizes(0.0), sizes(4.0)
    assert stiff[0] > soft[0]
    assert stiff[1] < soft[1] - 1.0


def test_placements_lie_in_their_ranges(patient):
    for seed in range(30):
        for view, header in drawing.HEADER_ANGLE_DEG.items():
            placement = drawing.draw_placement(patient.shape, view, np.random.default_rng(seed))
            assert drawing.ROLL_DEG[0] <= abs(placement.angle_deg - header) <= drawing.ROLL_DEG[1] <= 8.0
            assert drawing.SHARE[view][0] <= placement.share <= drawing.SHARE[view][1]
            behind = patient.shape.back(patient.shape.centre_m, patient.shape.centre_s) - placement.edge_p_mm
            assert drawing.EDGE_MM[0] <= behind <= drawing.EDGE_MM[1]


def test_the_cohort_is_as_hard_as_promised():
    least, most = drawing.SHARE["CC"]
    assert 0.40 <= least < most <= 0.55
    assert drawing.SHARE["MLO"][1] < most
    assert drawing.SHARE["3D"] == (0.21, 0.21)
    assert drawing.LESION.diameter_mm == (8.0, 20.0)
    assert drawing.VOLUME_CM3 == (250.0, 1000.0)
