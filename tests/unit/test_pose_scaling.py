"""Volume-preserving scaling against ellipsoids, whose shadows are ellipses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from mammoreg.geometry import ViewGeometry, breast_to_plate, plate_to_breast
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.scaling import fit_scaling
from mammoreg.pose.silhouette import ray_angles

HALF_AXES = np.array([60.0, 80.0, 50.0])
EDGE, MIDDLE, ANGLE = 20.0, 4.0, 7.0
VIEW = ViewGeometry(ANGLE, EDGE, MIDDLE, 0.0, 60.0, 650.0, 15.0, 0.2, 900, 600, parallel=True)
BACK_KEPT = 80.0 - 80.0 * 0.62**-0.5  # middle of the pressed ellipsoid: scaling leaves its back where it was


def ellipsoid() -> tuple[np.ndarray, np.ndarray]:
    """A faceted ellipsoid, its long axes along the plate frame at 7 degrees, as vertices and degenerate quads."""
    axis = np.linspace(-1.0, 1.0, 25)
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    shell = cube[np.abs(cube).max(axis=1) > 0.999]
    shell /= np.linalg.norm(shell, axis=1, keepdims=True)
    quads = ConvexHull(shell).simplices[:, [0, 1, 2, 2]].astype(np.intp)
    return plate_to_breast(shell * HALF_AXES + [3.0, 0.0, 10.0], ANGLE), quads


def ellipse(view: ViewGeometry, share: float, centre: tuple[float, float]) -> RadialOutline:
    """Shadow of the ellipsoid pressed to a share of its height, its middle at `centre` (medial, posterior)."""
    wide, t = share**-0.5, np.linspace(0.0, 2.0 * np.pi, 2000)
    medial, posterior = centre[0] + 60.0 * wide * np.cos(t), centre[1] + 80.0 * wide * np.sin(t)
    zoom = view.middle_magnification
    forward, along = (view.edge_p_mm - posterior) * zoom, (medial - view.middle_mm) * zoom
    points = np.stack([forward, along], axis=-1)
    start = int(np.argmin(np.where(forward < 0.0, along, np.inf)))
    points = np.roll(points, -start, axis=0)
    front = points[points[:, 0] > 0.0]
    return radial_outline(front, np.clip(front[:, 0] / 10.0, 0.0, 1.0), ray_angles(181))


def test_scaling_keeps_the_volume_and_fits_between_the_plates() -> None:
    points, quads = ellipsoid()
    view = replace(VIEW, thickness_mm=62.0)
    found = fit_scaling(points, quads, view, ellipse(view, 0.62, (3.0, BACK_KEPT)))
    assert np.linalg.det(found.matrix) == pytest.approx(1.0)
    pressed = points @ found.matrix.T + found.offset
    assert ConvexHull(pressed).volume == pytest.approx(ConvexHull(points).volume, rel=1e-9)
    assert np.ptp(pressed[:, 2]) == pytest.approx(62.0, abs=0.5)
    assert np.ptp(pressed[:, 0]) / np.ptp(breast_to_plate(points, ANGLE)[:, 0]) == pytest.approx(0.62**-0.5)
    assert found.uncompressed_mm == pytest.approx(100.0, abs=0.5)
    plates = found.alignment.view
    assert pressed[:, 2].min() == pytest.approx(plates.height_mm, abs=0.5)


def test_place_in_the_image_is_found_from_a_wrong_start() -> None:
    points, quads = ellipsoid()
    view = replace(VIEW, thickness_mm=62.0)
    outline = ellipse(view, 0.62, (3.0, BACK_KEPT))
    start = replace(view, edge_p_mm=EDGE + 9.0, middle_mm=MIDDLE - 8.0)
    found = fit_scaling(points, quads, start, outline).alignment
    assert found.view.middle_mm == pytest.approx(MIDDLE, abs=0.3)
    assert found.view.edge_p_mm == pytest.approx(EDGE, abs=0.5)
    assert found.rms_mm < 0.3


def test_known_height_moves_the_breast_to_the_plates() -> None:
    points, quads = ellipsoid()
    view = replace(VIEW, thickness_mm=62.0, height_mm=-47.0)
    found = fit_scaling(points, quads, view, ellipse(view, 0.62, (3.0, 0.0)), keep_height=True)
    pressed = points @ found.matrix.T + found.offset
    assert (pressed[:, 2].min(), pressed[:, 2].max()) == pytest.approx((-47.0, 15.0), abs=0.3)
    assert found.alignment.view.height_mm == -47.0


def test_breast_thinner_than_the_gap_is_not_stretched() -> None:
    points, quads = ellipsoid()
    view = replace(VIEW, thickness_mm=140.0)
    found = fit_scaling(points, quads, view, ellipse(view, 1.0, (3.0, 0.0)))
    np.testing.assert_allclose(found.matrix @ found.matrix.T, np.eye(3), atol=1e-12)
