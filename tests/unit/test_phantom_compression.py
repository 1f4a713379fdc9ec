"""Mechanics of digital patients."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.contact.plate import Plate
from mammoreg.fem.model import HyperelasticModel
from mammoreg.materials.elastic import neo_hookean
from mammoreg.phantom import patient as drawing
from mammoreg.phantom.compression import Press
from mammoreg.phantom.mechanics import element_moduli, wall_springs
from mammoreg.phantom.mesh import breast_mesh
from mammoreg.phantom.patient import Patient
from mammoreg.phantom.touch import SkinNodes


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
    before, limit = places + rng.normal(0, 0.3, places.shape), rng.uniform(0, 2, (2, 40))

    def force(x):
        return skin.touch(x, before, plates(), 5.0, limit).force

    step = 1e-6
    slope = np.stack([(force(places + step * e) - force(places - step * e)) / (2 * step) for e in np.eye(3)], axis=-1)
    np.testing.assert_allclose(-skin.touch(places, before, plates(), 5.0, limit).stiffness, slope, rtol=1e-3, atol=1e-2)


def test_friction_opposes_the_slip_and_stays_below_its_limit():
    places = np.array([[5.0, -30.0, -10.2]])
    skin = SkinNodes(np.array([0]), np.array([20.0]))
    limit = np.array([[0.8], [0.0]])
    slid = skin.touch(places, places - [3.0, 0.0, 0.0], plates(), 5.0, limit)
    stuck = skin.touch(places, places, plates(), 5.0, limit)
    assert slid.force[0, 0] == pytest.approx(-0.8 * 20.0, rel=1e-3)
    assert stuck.force[0, 0] == 0.0
    assert slid.force[0, 2] == stuck.force[0, 2] > 0.0


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
    placement = replace(patient.placements["CC"], share=0.2)
    press = Press(patient.anatomy, coarse, patient.mechanics, placement)
    found = press.close()
    front = found.deformed[found.deformed[:, 1] < placement.edge_p_mm - 20.0]
    assert front[:, 2].min() > found.height_mm - 0.6
    assert front[:, 2].max() < found.height_mm + found.gap_mm + 0.6
    assert found.gap_mm == pytest.approx(0.8 * found.uncompressed_mm)
    body = HyperelasticModel(press.model.points, coarse.hexes, neo_hookean(1.0))
    assert abs(body.volume_change(found.deformed)) < 0.03
    assert found.min_det_f > 0.2
    assert found.force_n > 1.0


def test_every_view_is_rolled_off_the_header():
    for seed in range(30):
        patient = Patient.draw(seed, ("CC", "MLO"), healthy=True, landmarks=1)
        for view, placement in patient.placements.items():
            off = abs(placement.angle_deg - drawing.HEADER_ANGLE_DEG[view])
            assert drawing.ROLL_DEG[0] <= off <= drawing.ROLL_DEG[1]
