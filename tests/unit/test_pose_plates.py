"""Plates found in synthetic masks of a breast between plates."""

import numpy as np
import pytest

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, breast_to_plate
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.plates import find_plates
from mammoreg.pose.second_volume import outline_of_mask, parallel_view
from mammoreg.pose.silhouette import ray_angles

EDGE, LOWER, UPPER = 10.0, -25.0, 20.0


def squeezed(angle_deg: float) -> Volume:
    """An ellipsoid of half axes 50, 70, 45 mm cut flat between plates in front of the edge, with a chest behind."""
    spacing = np.full(3, 1.4)
    origin = np.array([-75.0, -85.0, -75.0])
    axes = [o + s * np.arange(n) for o, s, n in zip(origin, spacing, (107, 96, 107), strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points = breast_to_plate(grid, angle_deg)
    inside = (points[..., 0] / 50.0) ** 2 + (points[..., 1] / 70.0) ** 2 + (points[..., 2] / 45.0) ** 2 < 1.0
    between = (points[..., 2] > LOWER) & (points[..., 2] < UPPER)
    body = (inside & (between | (points[..., 1] > EDGE))) | (grid[..., 1] > 30.0)
    return Volume(body.astype(np.uint8), origin, spacing)


@pytest.mark.parametrize("angle", [-6.0, 0.0, 4.0])
def test_tilt_heights_and_edge_are_found(angle: float) -> None:
    plates = find_plates(squeezed(angle))
    assert plates.angle_deg == pytest.approx(angle, abs=1.0)
    assert plates.lower_mm == pytest.approx(LOWER, abs=1.0)
    assert plates.upper_mm == pytest.approx(UPPER, abs=1.0)
    assert plates.edge_p_mm == pytest.approx(EDGE, abs=2.0)


def test_a_breast_without_plates_is_refused() -> None:
    axis = np.arange(-60.0, 61.0, 1.5)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    ball = Volume((x**2 + y**2 + z**2 < 50.0**2).astype(np.uint8), np.full(3, -60.0), np.full(3, 1.5))
    with pytest.raises(DataError, match="no two parallel flat faces"):
        find_plates(ball)


def test_outline_of_the_mask_is_the_ellipse_in_front_of_the_edge() -> None:
    mask = squeezed(0.0)
    plates = find_plates(mask)
    outline: RadialOutline = outline_of_mask(mask, parallel_view(mask, plates), ray_angles(181))
    view = parallel_view(mask, plates)
    trusted = outline.weight > 0.99
    points = outline.points()[trusted]
    medial, posterior = view.middle_mm + points[:, 1], view.edge_p_mm - points[:, 0]
    assert trusted.sum() > 90
    assert np.hypot(medial / 50.0, posterior / 70.0) == pytest.approx(np.ones(trusted.sum()), abs=0.02)
