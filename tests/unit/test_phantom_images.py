"""Deformed patients and their images."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.geometry import ViewGeometry, Volume, breast_to_plate
from mammoreg.phantom.anatomy import AIR, SOFT, Tissue
from mammoreg.phantom.mammogram import (
    FAT_PER_MM,
    GLAND_PER_MM,
    Exposure,
    Pectoral,
    Projection,
    attenuation,
    presented,
    project,
)
from mammoreg.phantom.mri import T1, Acquisition, acquire, bias_field, tissue_signal
from mammoreg.phantom.patient import Patient
from mammoreg.phantom.warp import Deformed

VIEW = ViewGeometry(20.0, 0.0, 5.0, -30.0, 60.0, 650.0, 15.0, 0.8, 150, 100)


@pytest.fixture(scope="module")
def patient():
    return Patient.draw(9, ("CC",), healthy=False, landmarks=12)


def slab(points, gland=0.0, ball=None):
    """Fat with gland everywhere, and a ball of lesion (centre, radius)."""
    count = len(points)
    lesion = np.zeros(count, dtype=np.float32)
    if ball is not None:
        lesion = (np.linalg.norm(points - ball[0], axis=1) < ball[1]).astype(np.float32)
    return Tissue(np.full(count, SOFT, dtype=np.uint8), np.full(count, gland, dtype=np.float32), lesion)


def test_an_affine_deformation_is_recovered(patient):
    matrix = np.array([[1.1, 0.05, 0.0], [0.0, 1.05, 0.1], [0.02, 0.0, 0.8]])
    deformed = Deformed(patient.anatomy, patient.mesh, patient.mesh.points @ matrix.T + [3.0, -2.0, 1.0])
    moved = deformed.forward(patient.landmarks)
    np.testing.assert_allclose(moved, patient.landmarks @ matrix.T + [3.0, -2.0, 1.0], atol=1e-6)
    there = deformed.tabulated(moved.min(axis=0) - 5.0, moved.max(axis=0) + 5.0).at(moved)
    here = patient.anatomy.at(patient.landmarks)
    assert np.array_equal(there.kind, here.kind)
    np.testing.assert_allclose(there.gland, here.gland, atol=1e-3)


def test_the_nipple_follows_a_rotation(patient):
    angle = np.deg2rad(25.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    deformed = Deformed(patient.anatomy, patient.mesh, patient.mesh.points @ turn.T)
    np.testing.assert_allclose(deformed.nipple, turn @ patient.shape.nipple, atol=1e-6)


def test_air_left_behind_by_the_breast_stays_air(patient):
    squeezed = patient.mesh.points * [1.0, 1.0, 0.5]
    deformed = Deformed(patient.anatomy, patient.mesh, squeezed)
    column = patient.shape.axis(0.5) * [1.0, 1.0, 0.0] + np.outer(np.arange(90.0), [0.0, 0.0, 1.0])
    tissue = column[patient.anatomy.at(column).kind != AIR]
    highest = tissue[-1]
    origins = deformed.tabulated(highest - 45.0, highest + 5.0)
    assert highest[2] > 25.0
    assert origins.at(highest[None]).kind[0] == AIR
    assert origins.at(highest[None] * [1.0, 1.0, 0.4]).kind[0] != AIR


def test_a_homogeneous_slab_attenuates_by_its_thickness_along_the_beam():
    image = project(VIEW, lambda x: slab(x, gland=1.0), (-90.0, 90.0), -120.0)
    centre = image.attenuation[round(0.5 * (VIEW.rows - 1)), 0]
    assert centre == pytest.approx(GLAND_PER_MM * VIEW.thickness_mm, rel=1e-3)
    assert image.attenuation[0, 80] > centre


def test_a_ball_is_seen_where_the_geometry_projects_it():
    centre = np.array([20.0, -40.0, 5.0])
    image = project(VIEW, lambda x: slab(x, ball=(centre, 6.0)), (-90.0, 90.0), -120.0)
    row, column = np.argwhere(image.lesion_mask).mean(axis=0)
    wanted = VIEW.project(breast_to_plate(centre, VIEW.angle_deg))
    assert np.abs(np.array([column, row]) - wanted).max() * VIEW.pixel_mm < 0.4
    assert image.lesion_mm.max() == pytest.approx(12.0, abs=0.8)


def test_the_pectoral_wedge_lies_in_the_upper_posterior_corner():
    pectoral = Pectoral(-50.0, 30.0, 60.0, 0.5)
    middle = VIEW.height_mm + 0.5 * VIEW.thickness_mm
    points = np.array(
        [[-49.0, -1.0, middle], [-49.0, -40.0, middle], [20.0, -1.0, middle], [-49.0, -1.0, VIEW.height_mm]]
    )
    assert pectoral.holds(points, VIEW).tolist() == [True, False, False, False]


def test_a_presented_image_is_bright_where_tissue_is_dense():
    path = np.zeros((120, 100), dtype=np.float32)
    path[20:100, :70] = FAT_PER_MM * 50.0
    path[40:60, 20:40] = GLAND_PER_MM * 50.0
    exposure = Exposure(4e4, 0.3, 10.0, 0.15, 0.6)
    image = presented(Projection(path, path * 0.0), exposure, 1.0, np.random.default_rng(1))
    assert image.dtype == np.uint16
    assert image.max() <= 4095
    assert np.median(image[45:55, 25:35]) > np.median(image[80:95, 10:60]) > np.median(image[:, 80:]) + 200
    again = presented(Projection(path, path * 0.0), exposure, 1.0, np.random.default_rng(1))
    assert np.array_equal(image, again)


def test_attenuation_mixes_fat_gland_and_lesion():
    mixed = replace(slab(np.zeros((1, 3))), gland=np.array([0.5], dtype=np.float32))
    assert attenuation(mixed)[0] == pytest.approx(0.5 * (FAT_PER_MM + GLAND_PER_MM), rel=1e-5)


def test_mr_signal_has_rician_noise_and_the_tissues_level():
    grid = Volume(np.zeros((20, 20, 20)), np.zeros(3), np.full(3, 1.4))
    quiet = Acquisition(T1, noise=20.0, bias=0.0)
    fat = acquire(grid, lambda x: slab(x), quiet, np.random.default_rng(3))
    air = acquire(grid, lambda x: Tissue(*(np.zeros(len(x), t) for t in "Bff")), quiet, np.random.default_rng(3))
    assert fat.mean() == pytest.approx(T1.fat, rel=0.01)
    assert fat.std() == pytest.approx(20.0, rel=0.1)
    assert air.mean() == pytest.approx(20.0 * np.sqrt(np.pi / 2.0), rel=0.05)
    assert tissue_signal(slab(np.zeros((1, 3)), gland=1.0), T1)[0] == pytest.approx(T1.gland)


def test_the_bias_field_is_smooth_and_brighter_in_front():
    grid = Volume(np.zeros((40, 50, 40)), np.zeros(3), np.full(3, 1.4))
    field = bias_field(grid, 0.5, np.random.default_rng(4))
    assert field[:, :5].mean() > 1.1 * field[:, -5:].mean()
    assert max(np.abs(np.diff(np.log(field), axis=k)).max() for k in range(3)) < 0.05
