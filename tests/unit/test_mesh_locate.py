"""Location of points in hexahedra: round trips, points outside, interpolation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mammoreg.meshing.locate import Locator, interpolate
from tests.unit.block_meshes import half_ellipsoid
from tests.unit.test_mesh_block import bent_block


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.integers(1, 6))
def test_points_come_back_to_where_they_are(seed, n):
    mesh = bent_block(n, seed, noise=2.0 / n)
    rng = np.random.default_rng(seed)
    element, local = rng.integers(0, n**3, 500), rng.uniform(-1.0, 1.0, (500, 3))
    points = interpolate(mesh.hexes(), element, local, mesh.points)
    found, where, inside = Locator(mesh.points, mesh.hexes()).locate(points)
    assert inside.all()
    np.testing.assert_allclose(interpolate(mesh.hexes(), found, where, mesh.points), points, atol=1e-4)
    within = (np.abs(local) < 0.999).all(axis=1)
    np.testing.assert_array_equal(found[within], element[within])
    np.testing.assert_allclose(where[within], local[within], atol=1e-5)


def test_flat_corners_of_a_round_body_are_found():
    mesh = half_ellipsoid(7)
    rng = np.random.default_rng(1)
    element, local = rng.integers(0, 343, 4000), rng.uniform(-1.0, 1.0, (4000, 3))
    points = interpolate(mesh.hexes(), element, local, mesh.points)
    found, where, inside = Locator(mesh.points, mesh.hexes()).locate(points)
    assert inside.all()
    np.testing.assert_allclose(interpolate(mesh.hexes(), found, where, mesh.points), points, atol=1e-4)


def test_points_outside_get_the_nearest_element_and_bounded_coordinates():
    mesh = bent_block(4)
    quads = mesh.skin_quads()
    corners = mesh.points[quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    owner = [np.flatnonzero(np.isin(mesh.hexes(), quad).sum(axis=1) == 4)[0] for quad in quads]
    locator = Locator(mesh.points, mesh.hexes())
    near, local, inside = locator.locate(corners.mean(axis=1) + 2.0 * normal)
    assert not inside.any()
    np.testing.assert_array_equal(near, owner)
    assert ((np.abs(local).max(axis=1) > 1.0) & (np.abs(local).max(axis=1) < 1.5)).all()
    far = locator.locate(corners.mean(axis=1) + 500.0 * normal)
    assert not far[2].any()
    assert np.abs(far[1]).max() <= 1.5
    assert np.isfinite(far[1]).all()


def test_a_linear_field_is_interpolated_and_extrapolated_exactly():
    mesh = bent_block(3)
    rng = np.random.default_rng(0)
    points = rng.uniform(-40.0, 40.0, (300, 3))
    element, local, inside = Locator(mesh.points, mesh.hexes()).locate(points)
    field = mesh.points @ [1.0, -2.0, 0.5] + 3.0
    found = interpolate(mesh.hexes(), element, local, field)
    assert found.shape == (300,)
    np.testing.assert_allclose(found[inside], points[inside] @ [1.0, -2.0, 0.5] + 3.0, atol=1e-3)
    assert 0.5 < inside.mean() < 1.0


@pytest.mark.parametrize("count", [0, 1])
def test_few_points(count):
    mesh = bent_block(2)
    element, local, inside = Locator(mesh.points, mesh.hexes()).locate(np.zeros((count, 3)))
    assert (len(element), local.shape, len(inside)) == (count, (count, 3), count)
