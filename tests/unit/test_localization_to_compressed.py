"""Placing a surface by a body's outline, against balls and ellipsoids."""

import numpy as np
import pytest

from mammoreg.geometry import Volume
from mammoreg.geometry.frames import plate_rotation
from mammoreg.localization.to_compressed import SecondVolume, fit_surface_to_outline, signed_distance


def half_ball_mask(radius: float = 60.0, spacing: float = 2.0) -> Volume:
    """Mask of a half ball in front (p < 0) of the origin, breast frame."""
    n = int(radius / spacing) + 2
    axis = np.arange(-n, n + 1) * spacing
    m, p, s = np.meshgrid(axis, axis, axis, indexing="ij")
    return Volume((m**2 + p**2 + s**2 < radius**2) & (p <= 0), np.full(3, axis[0]), np.full(3, spacing))


def test_signed_distance_of_a_ball() -> None:
    distance = signed_distance(half_ball_mask())
    centre = distance.sample(np.array([[0.0, -30.0, 0.0]]))[0]
    assert centre == pytest.approx(-30.0, abs=1.5)
    assert distance.sample(np.array([[0.0, -62.0, 0.0]]))[0] == pytest.approx(2.0, abs=1.0)
    with pytest.raises(ValueError, match="no surface"):
        signed_distance(Volume(np.zeros((3, 3, 3)), np.zeros(3), np.ones(3)))


def skin_points(radii: tuple[float, float, float]) -> np.ndarray:
    """Points on a half ellipsoid in front of p = 0."""
    golden = np.pi * (3 - np.sqrt(5.0))
    k = np.arange(1500)
    p = -(k + 0.5) / 1500
    ring = np.sqrt(1 - p**2)
    return np.stack([ring * np.cos(golden * k), p, ring * np.sin(golden * k)], axis=1) * np.array(radii)


def ellipsoid_mask(radii: tuple[float, float, float], shift: np.ndarray, turn: np.ndarray) -> Volume:
    axis = np.arange(-90, 91, 2.0)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    local = (grid - shift) @ turn
    body = np.sum((local / np.array(radii)) ** 2, axis=-1) < 1
    return Volume(body | (local[..., 1] > 0), np.full(3, -90.0), np.full(3, 2.0))


def test_outline_fit_recovers_a_shift() -> None:
    radii, shift = (60.0, 70.0, 40.0), np.array([3.0, -4.0, 5.0])
    placed = fit_surface_to_outline(
        skin_points(radii), signed_distance(ellipsoid_mask(radii, shift, np.eye(3))), rotate=False
    )
    np.testing.assert_allclose(placed.matrix, np.eye(3))
    np.testing.assert_allclose(placed.offset, shift, atol=0.4)


def test_outline_fit_recovers_a_turn() -> None:
    radii, shift = (60.0, 70.0, 40.0), np.array([2.0, -3.0, 4.0])
    turn = plate_rotation(8.0)
    points = skin_points(radii)
    outline = signed_distance(ellipsoid_mask(radii, shift, turn))
    placed = fit_surface_to_outline(points, outline, rotate=True, base_mm=1.0)
    inner = 0.5 * points
    assert np.linalg.norm(placed.forward(inner) - (inner @ turn.T + shift), axis=1).max() < 1.0


def second_volume_of(radii: tuple[float, float, float], shift: np.ndarray, turn: np.ndarray) -> SecondVolume:
    return SecondVolume(ellipsoid_mask(radii, shift, turn), skin_points((60.0, 70.0, 40.0))[::3])


@pytest.mark.parametrize("shift", [(4.0, -6.0, 10.0), (-2.0, 4.0, -8.0)])
def test_rigid_recovers_a_translation_and_turns_nothing(shift: tuple[float, float, float]) -> None:
    """By whole voxels, so that what the voxels' steps do to one place they do to the other."""
    inner = 0.5 * skin_points((60.0, 70.0, 40.0))
    before, after = (
        second_volume_of((60.0, 70.0, 40.0), np.array(s), np.eye(3)).rigid(inner) for s in ((0.0, 0.0, 0.0), shift)
    )
    np.testing.assert_allclose(after - before, np.broadcast_to(shift, inner.shape), atol=1e-3)
    np.testing.assert_allclose(before - inner, np.broadcast_to((before - inner)[0], inner.shape), atol=1e-9)
    np.testing.assert_allclose(before, inner, atol=0.4)


def test_rigid_does_not_turn_a_body_that_is_only_pressed_flat() -> None:
    inner = 0.5 * skin_points((60.0, 70.0, 40.0))
    carried = second_volume_of((68.0, 76.0, 32.0), np.array([0.0, 0.0, -12.0]), np.eye(3)).rigid(inner)
    np.testing.assert_allclose(carried - inner, np.broadcast_to((carried - inner).mean(axis=0), inner.shape), atol=1e-9)


def test_rigid_turns_with_the_body() -> None:
    inner, turn = 0.5 * skin_points((60.0, 70.0, 40.0)), plate_rotation(12.0)
    carried = second_volume_of((66.0, 70.0, 36.0), np.array([0.0, 0.0, -12.0]), turn).rigid(inner)
    assert np.linalg.norm(carried - (inner @ turn.T + [0.0, 0.0, -12.0]), axis=1).max() < 2.5


def test_slopes_over_a_wide_base_find_one_place_from_everywhere() -> None:
    """Near the same surface, and whatever the start, which the kinks of the voxels' distances do not hold up."""
    radii, shift = (60.0, 70.0, 40.0), np.array([2.0, -3.0, 4.0])
    outline = signed_distance(ellipsoid_mask(radii, shift, np.eye(3)))
    points = skin_points((60.5, 68.0, 41.0))
    starts = [np.zeros(3), np.array([1.3, -0.7, 0.9]), np.array([-0.8, 1.1, -1.2])]
    found = [fit_surface_to_outline(points + s, outline, rotate=False, base_mm=1.0) for s in starts]
    inner = 0.5 * points
    places = [fit.forward(inner + s) for fit, s in zip(found, starts, strict=True)]
    assert max(np.linalg.norm(p - places[0], axis=1).max() for p in places) < 0.05
    np.testing.assert_allclose((places[0] - inner).mean(axis=0)[[0, 2]], shift[[0, 2]], atol=0.4)
