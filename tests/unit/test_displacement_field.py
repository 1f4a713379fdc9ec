"""Displacement fields on grids: right up to the mesh's surface, smooth beyond, one the other's inverse."""

import numpy as np
import pytest
from scipy import ndimage

from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.localization.displacement import DisplacementField, MeshGrid
from mammoreg.meshing.block import BlockMesh
from tests.unit.breast_block import breast_block

SPACING_MM, MARGIN_MM = 2.0, 8.0


def squeezed(points: np.ndarray) -> np.ndarray:
    """A smooth deformation like a compression: thinner in z, wider the farther in front, and bent."""
    x, y, z = points.T
    wide = 1.0 + 0.25 * np.exp(-(z**2) / 900.0)
    return np.stack([x * wide + 0.002 * z**2, y * wide - 5.0, 0.6 * z + 0.1 * x], axis=1)


def sampled(field: DisplacementField, points: np.ndarray) -> np.ndarray:
    """Linear interpolation, as a reader of the files does it."""
    index = field.inside.to_index(points).T
    return np.stack([ndimage.map_coordinates(field.vectors[..., axis], index, order=1) for axis in range(3)], axis=1)


@pytest.fixture(scope="module")
def block() -> BlockMesh:
    return breast_block(5)


@pytest.fixture(scope="module")
def grid(block: BlockMesh) -> MeshGrid:
    return MeshGrid(block, SPACING_MM, MARGIN_MM)


def test_an_affine_map_is_reproduced_everywhere_but_far_beyond(block: BlockMesh, grid: MeshGrid) -> None:
    matrix, offset = np.array([[1.1, 0.2, 0.0], [0.0, 1.05, -0.1], [0.1, 0.0, 0.7]]), np.array([3.0, -2.0, 5.0])
    field = grid.displacement(block.points @ matrix.T + offset)
    near = ndimage.distance_transform_edt(field.inside.data == 0) <= 3.0
    points = field.inside.centres(near)
    expected = points @ matrix.T + offset - points
    np.testing.assert_allclose(field.vectors[near], expected, atol=1e-4)


def test_at_the_surface_the_error_is_that_of_interpolation(block: BlockMesh, grid: MeshGrid) -> None:
    end = squeezed(block.points)
    fine, moved = block.subdivide(4), BlockMesh(block.n, end).subdivide(4).points
    surface = np.union1d(fine.skin_nodes(), fine.back_nodes())
    found = fine.points[surface] + sampled(grid.displacement(end), fine.points[surface])
    error = np.linalg.norm(found - moved[surface], axis=1)
    assert error.mean() < 0.1
    assert error.max() < 1.0


def test_the_inverse_undoes_the_field(block: BlockMesh, grid: MeshGrid) -> None:
    end = squeezed(block.points)
    forward = grid.displacement(end)
    inverse = MeshGrid(BlockMesh(block.n, end), SPACING_MM, MARGIN_MM).displacement(block.points)
    points = forward.inside.centres(forward.inside.data != 0)
    carried = points + sampled(forward, points)
    error = np.linalg.norm(carried + sampled(inverse, carried) - points, axis=1)
    assert error.mean() < 0.05
    assert np.quantile(error, 0.99) < 0.4


def test_beyond_the_surface_the_field_does_not_jump(block: BlockMesh, grid: MeshGrid) -> None:
    end = squeezed(block.points)
    field = grid.displacement(end)
    within = np.linalg.norm(end - block.points, axis=1).max()
    assert np.linalg.norm(field.vectors, axis=-1).max() < 1.5 * within
    for axis in range(3):
        step = np.linalg.norm(np.diff(field.vectors, axis=axis), axis=-1)
        assert step.max() < 0.25 * within


def test_what_lies_outside_between_the_plates_comes_from_outside(block: BlockMesh, grid: MeshGrid) -> None:
    end = squeezed(block.points)
    back = MeshGrid(BlockMesh(block.n, end), SPACING_MM, MARGIN_MM)
    beyond = back.inside.centres(back.inside.data == 0)
    origin = beyond + sampled(back.displacement(block.points), beyond)
    depth = ndimage.distance_transform_edt(grid.inside.data, sampling=SPACING_MM)
    found = ndimage.map_coordinates(depth, grid.inside.to_index(origin).T, order=1)
    assert found.max() < 1.5 * SPACING_MM


def test_a_left_breast_is_the_mirror_image(block: BlockMesh, grid: MeshGrid) -> None:
    end = squeezed(block.points)
    field = grid.displacement(end)
    left, right = field.to_lps("L"), field.to_lps("R")
    points = block.points[::5]
    np.testing.assert_allclose(
        lps_to_breast(sampled(left, breast_to_lps(points, "L")), "L"), sampled(right, points), atol=1e-5
    )
