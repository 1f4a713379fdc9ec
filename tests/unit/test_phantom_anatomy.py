"""Shape, mesh, lesion and tissue of digital patients."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.meshing.trilinear import CORNERS, jacobians, volumes
from mammoreg.phantom import lesion
from mammoreg.phantom.anatomy import AIR, MUSCLE, SKIN, SOFT
from mammoreg.phantom.lesion import LesionRule, draw_landmarks
from mammoreg.phantom.mesh import breast_mesh
from mammoreg.phantom.patient import LESION, MESH, VOLUME_CM3, Patient, draw_shape
from mammoreg.phantom.shape import smooth_maximum
from mammoreg.phantom.skin_points import skin_points

SEEDS = range(40, 46)


def shape_of(seed):
    return draw_shape(np.random.default_rng(seed))


@pytest.fixture(scope="module")
def patient():
    return Patient.draw(7, ("CC",), healthy=False, landmarks=10)


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(1, 30))
def test_smooth_maximum_lies_above_the_maximum_by_at_most_a_quarter_of_its_width(a, b, width):
    found = float(smooth_maximum(np.array(a), np.array(b), width))
    assert max(a, b) <= found <= max(a, b) + 0.25 * width + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_every_drawn_breast_has_a_sound_mesh(seed):
    mesh = breast_mesh(shape_of(seed), **MESH)
    corner = jacobians(mesh.points[mesh.hexes], CORNERS)
    scaled = np.linalg.det(corner) / np.linalg.norm(corner, axis=2).prod(axis=2)
    assert scaled.min() > 0.2


@pytest.mark.parametrize("seed", SEEDS)
def test_the_mesh_fills_the_shape_in_front_of_the_back(seed):
    shape = shape_of(seed)
    mesh = breast_mesh(shape, **MESH)
    lowest, highest = mesh.points.min(axis=0) - 2.0, mesh.points.max(axis=0) + 2.0
    m, p, s = (np.arange(a, b, 1.5) for a, b in zip(lowest, highest, strict=True))
    m, p, s = m[:, None, None], p[None, :, None], s[None, None, :]
    inside = (shape.level(m, p, s) > 0.0) & (p < shape.back(m, s))
    assert volumes(mesh.points[mesh.hexes]).sum() == pytest.approx(inside.sum() * 1.5**3, rel=0.02)
    assert 0.97 * VOLUME_CM3[0] < inside.sum() * 1.5**3 * 1e-3 < 1.03 * VOLUME_CM3[1]


def test_skin_and_back_close_the_mesh():
    mesh = breast_mesh(shape_of(41), core=4, rows=4, shells=2)
    faces = mesh.points[np.concatenate([mesh.skin_quads, mesh.back_quads])]
    normal = 0.5 * np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    # Outward normals of a closed surface cancel; the volume follows from them (divergence theorem).
    assert np.abs(normal.sum(axis=0)).max() < 1e-6 * np.abs(normal).sum()
    enclosed = (normal * faces.mean(axis=1)).sum() / 3.0
    assert enclosed == pytest.approx(volumes(mesh.points[mesh.hexes]).sum(), rel=0.01)


def test_skin_nodes_lie_on_the_skin():
    shape = shape_of(43)
    mesh = breast_mesh(shape, **MESH)
    assert np.abs(shape.level(*mesh.points[np.unique(mesh.skin_quads)].T)).max() < 0.05
    assert (
        np.abs(shape.back(mesh.points[mesh.back, 0], mesh.points[mesh.back, 2]) - mesh.points[mesh.back, 1]).max()
        < 1e-9
    )


def test_fibres_follow_the_bent_axis():
    shape = shape_of(42)
    t = np.array([0.2, 0.6, 0.95])
    points, step = shape.axis(t), 1e-4
    slope = (shape.axis(t + step) - shape.axis(t - step)) / (2.0 * step)
    along = shape.axis_direction(points[:, 1])
    np.testing.assert_allclose(along, slope / np.linalg.norm(slope, axis=1, keepdims=True), atol=1e-6)


def test_a_lesion_keeps_its_distances():
    shape = shape_of(44)
    for seed in range(20):
        found = LESION.draw(shape, np.random.default_rng(seed))
        radius = found.half_axes.max()
        assert shape.level(*found.centre) >= radius + LESION.skin_mm
        assert np.linalg.norm(found.centre - shape.nipple) >= LESION.nipple_mm
        assert shape.back(found.centre[0], found.centre[2]) - found.centre[1] >= radius + LESION.back_mm
        assert abs(found.centre[0] - shape.nipple[0]) >= LESION.aside_mm
        assert LESION.diameter_mm[0] <= 2.0 * np.cbrt(found.half_axes.prod()) <= LESION.diameter_mm[1]
        assert found.share(found.centre[None])[0] == 1.0
        assert found.share(found.centre[None] + 1.01 * found.reach_mm * np.eye(3)).max() == 0.0


def test_a_rule_that_no_breast_fulfils_says_so(monkeypatch):
    monkeypatch.setattr(lesion, "TRIES", 300)
    rule = LesionRule((40.0, 50.0), 60.0, 60.0, 50.0, 10.0, (0.3, 0.7))
    with pytest.raises(ValueError, match="loosen the rule"):
        rule.draw(shape_of(40), np.random.default_rng(0))
    with pytest.raises(ValueError, match="landmarks fit"):
        draw_landmarks(shape_of(40), np.random.default_rng(0), 400, 6.0, 10.0, 30.0)


def test_the_same_seed_draws_the_same_patient(patient):
    again = Patient.draw(7, ("CC", "MLO"), healthy=False, landmarks=10)
    other = Patient.draw(8, ("CC",), healthy=False, landmarks=10)
    assert np.array_equal(again.landmarks, patient.landmarks)
    assert again.placements["CC"] == patient.placements["CC"]
    assert not np.array_equal(other.landmarks, patient.landmarks)


def test_tissues_follow_each_other_from_the_air_to_the_chest(patient):
    shape = patient.shape
    p = np.arange(shape.nipple[1] - 5.0, shape.base_p + 40.0, 0.25)
    ray = np.column_stack([np.full_like(p, shape.centre_m), p, np.full_like(p, shape.centre_s + 5.0)])
    kind = patient.anatomy.at(ray).kind
    order = kind[np.flatnonzero(np.diff(kind, prepend=255))]
    assert order[:4].tolist() == [AIR, SKIN, SOFT, MUSCLE]
    assert 1.0 <= 0.25 * (kind == SKIN).sum() <= 2.5


def test_gland_takes_its_share_of_the_breast(patient):
    mesh = patient.mesh
    centres = mesh.points[mesh.hexes].mean(axis=1)
    size = volumes(mesh.points[mesh.hexes])
    share = np.average(patient.anatomy.at(centres).gland, weights=size)
    assert share == pytest.approx(patient.gland_share, abs=0.08)


def test_the_other_side_mirrors_this_one_without_its_lesion(patient):
    centre = patient.lesion.centre[None]
    here, there = patient.tissue_of_both_sides(centre), patient.tissue_of_both_sides(centre * [-1.0, 1.0, 1.0])
    assert here.lesion[0] == 1.0
    assert there.lesion[0] == 0.0
    assert here.gland[0] == there.gland[0]


def test_skin_points_are_spread_over_the_skin(patient):
    nodes = skin_points(patient.mesh, 16)
    places = patient.mesh.points[nodes]
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1) + 1e3 * np.eye(16)
    assert len(set(nodes.tolist())) == 16
    assert apart.min() > 15.0
