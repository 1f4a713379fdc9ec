"""Silhouettes and their alignment against shapes with a known outline."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.measure import marching_cubes

from mammoreg.geometry import ViewGeometry
from mammoreg.pose.alignment import align, measure
from mammoreg.pose.outline import radial_outline
from mammoreg.pose.silhouette import detector_mm, polar_to_detector, quad_edges, ray_angles, silhouette

VIEW = ViewGeometry(0.0, 10.0, 5.0, -20.0, 40.0, 650.0, 15.0, 0.2, 800, 500)
RADIUS = 45.0


def ball(centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A faceted ball of 45 mm as vertices and degenerate quads."""
    axis = np.linspace(-50.0, 50.0, 51)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    vertices, faces, _, _ = marching_cubes(RADIUS - np.sqrt(x**2 + y**2 + z**2), 0.0, spacing=(2.0, 2.0, 2.0))
    return vertices - 50.0 + centre, faces[:, [0, 1, 2, 2]].astype(np.intp)


def test_silhouette_of_a_ball_in_a_cone_beam_is_the_tangent_cone() -> None:
    centre = np.array([VIEW.middle_mm, VIEW.edge_p_mm, 0.0])  # below the source: the shadow is a circle
    vertices, quads = ball(centre)
    shadow = silhouette(detector_mm(vertices, VIEW), quad_edges(quads), 0.0, ray_angles(181))
    height = VIEW.source[2] - centre[2]
    expected = VIEW.source_detector_mm * RADIUS / np.sqrt(height**2 - RADIUS**2)
    assert shadow.radius == pytest.approx(np.full(181, expected), abs=0.15)


def test_rays_without_an_edge_are_not_invented() -> None:
    points = np.array([[10.0, 5.0], [10.0, 15.0], [20.0, 15.0], [20.0, 5.0]])
    theta = ray_angles(181)
    shadow = silhouette(points, quad_edges(np.array([[0, 1, 2, 3]])), 0.0, theta)
    hit = (theta > np.arctan2(5.0, 20.0)) & (theta < np.arctan2(15.0, 10.0))
    assert np.isfinite(shadow.radius[hit]).all()
    assert np.isnan(shadow.radius[~hit]).all()


def test_silhouette_points_lie_on_the_edges_that_realise_them() -> None:
    vertices, quads = ball(np.array([0.0, -10.0, 0.0]))
    flat = detector_mm(vertices, VIEW)
    shadow = silhouette(flat, quad_edges(quads), 3.0, ray_angles(91))
    a, b = flat[shadow.edge_nodes[:, 0]], flat[shadow.edge_nodes[:, 1]]
    on_edge = a + shadow.edge_weight[:, None] * (b - a)
    assert on_edge == pytest.approx(polar_to_detector(shadow.theta, shadow.radius, 3.0), abs=1e-9)


@settings(max_examples=15, deadline=None)
@given(edge=st.floats(-12.0, 12.0), middle=st.floats(-12.0, 12.0))
def test_alignment_recovers_a_shift_of_the_image(edge: float, middle: float) -> None:
    centre = np.array([8.0, -5.0, 2.0])
    vertices, quads = ball(centre)
    vertices = vertices * np.array([1.0, 1.2, 1.0])
    flat = silhouette(detector_mm(vertices, VIEW), quad_edges(quads), 0.0, ray_angles(361)).points()
    outline = radial_outline(flat, np.clip(flat[:, 0] / 10.0, 0.0, 1.0), ray_angles(181))
    moved = replace(VIEW, edge_p_mm=VIEW.edge_p_mm + edge, middle_mm=VIEW.middle_mm + middle)
    found = align(vertices, quads, moved, outline)
    assert found.view.edge_p_mm == pytest.approx(VIEW.edge_p_mm, abs=0.15)
    assert found.view.middle_mm == pytest.approx(VIEW.middle_mm, abs=0.15)
    assert found.rms_mm < 0.1


def test_gap_is_positive_where_the_outline_lies_outside_the_model() -> None:
    vertices, quads = ball(np.array([5.0, 10.0, 0.0]))
    flat = silhouette(detector_mm(vertices * [1.0, 1.0, 1.0], VIEW), quad_edges(quads), 0.0, ray_angles(361)).points()
    outline = radial_outline(flat * 1.1, np.ones(len(flat)), ray_angles(91))
    state = measure(vertices, quads, VIEW, outline)
    assert np.nanmin(state.gap_mm) > 3.0


def test_missing_outline_has_no_weight() -> None:
    points = np.stack([np.full(50, 40.0), np.linspace(-20.0, 20.0, 50)], axis=-1)
    outline = radial_outline(points, np.ones(50), ray_angles(181))
    missing = np.isnan(outline.radius)
    assert missing.any()
    assert (outline.weight[missing] == 0.0).all()
    assert outline.weight[~missing] == pytest.approx(1.0)
