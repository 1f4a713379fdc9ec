"""The deformed breast on a grid of the plate frame."""

import numpy as np
import pytest

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.localization.deformation import AffineDeformation, MeshDeformation, MethodView, ReferenceMesh
from mammoreg.materials.attenuation import ATTENUATION_20KEV_PER_MM
from mammoreg.projection.deformed import MeshInverse, grid_around, resample, undeformed_positions
from mammoreg.projection.method import deform_breast, project_breast, tissue_of_labels
from mammoreg.projection.regular import interpolate_axis
from tests.unit.block_meshes import compress, expand, half_ellipsoid

VIEW = ViewGeometry(
    angle_deg=0.0, edge_p_mm=-5.0, middle_mm=2.0, height_mm=-40.0, thickness_mm=88.0, source_detector_mm=650.0,
    support_detector_mm=15.0, pixel_mm=0.5, rows=400, columns=240,
)  # fmt: skip


@pytest.fixture(scope="module")
def mesh():
    return half_ellipsoid()


def test_inverse_of_an_affine_compression_is_exact_inside_and_in_the_shell(mesh):
    inverse = MeshInverse(mesh.points, compress(mesh.points), mesh.hexes())
    inside = mesh.points[mesh.hexes()].mean(axis=1)
    assert inverse(compress(inside)) == pytest.approx(inside, abs=1e-3)
    tip = compress(np.array([[0.0, -75.0, 0.0]])) + np.array([0.0, -3.0, 0.0])
    assert inverse(tip) == pytest.approx(expand(tip), abs=0.2)
    assert np.isnan(inverse(tip + np.array([0.0, -20.0, 0.0]))).all()


def test_grid_interpolation_of_the_inverse_is_good_to_a_tenth_of_a_millimetre(mesh):
    def bend(points):
        return compress(points) + np.stack(
            [0.001 * points[:, 2] ** 2, np.zeros(len(points)), 0.0008 * points[:, 0] ** 2], axis=1
        )

    inverse = MeshInverse(mesh.points, bend(mesh.points), mesh.hexes())
    grid = grid_around(bend(mesh.points), 1.4)
    field = undeformed_positions(inverse, grid)
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (2000, 3)) * [40.0, 25.0, 35.0] + [0.0, -30.0, 0.0]
    index = np.rint((bend(places) - grid.origin) / 1.4).astype(int)
    exact = inverse(grid.origin + 1.4 * index)
    error = np.linalg.norm(field[tuple(index.T)] - exact, axis=1)
    assert np.nanquantile(error, 0.95) < 0.1


def test_deformed_volume_carries_structures_and_keeps_nothing_outside(mesh):
    axes = [np.arange(-80.0, 81.0, 2.0), np.arange(-90.0, 10.0, 2.0), np.arange(-80.0, 81.0, 2.0)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    centre = np.array([15.0, -30.0, 10.0])
    ball = Volume(
        (np.linalg.norm(points - centre, axis=-1) < 9.0).astype(np.float32),
        np.array([axis[0] for axis in axes]),
        np.full(3, 2.0),
    )
    inverse = MeshInverse(mesh.points, compress(mesh.points), mesh.hexes())
    grid = grid_around(compress(mesh.points), 1.4)
    carried = grid.volume(resample(ball, undeformed_positions(inverse, grid)))
    where = np.stack(np.meshgrid(*(np.arange(size) for size in grid.shape), indexing="ij"), axis=-1)
    found = np.einsum("ijk,ijkc->c", carried.data, carried.to_world(where)) / carried.data.sum()
    assert found == pytest.approx(compress(centre), abs=0.1)
    assert carried.data.sum() * 1.4**3 == pytest.approx(ball.data.sum() * 8.0, rel=0.02)
    assert carried.data[0, 0, 0] == 0.0


def test_mesh_and_affine_methods_of_the_same_map_project_alike(mesh):
    axes = [np.arange(-80.0, 81.0, 2.0), np.arange(-90.0, 10.0, 2.0), np.arange(-80.0, 81.0, 2.0)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    origin, spacing = np.array([axis[0] for axis in axes]), np.full(3, 2.0)
    inside = (((points / [52.0, 70.0, 48.0]) ** 2).sum(axis=-1) < 1.0) & (points[..., 1] < 0.0)
    breast = Volume(inside.astype(np.uint8), origin, spacing)
    gland = np.linalg.norm(points - [0.0, -35.0, 10.0], axis=-1) < 12.0
    with_gland = tissue_of_labels(breast.with_data(np.where(gland, 2, 1).astype(np.uint8)), breast)
    without = tissue_of_labels(breast, breast)
    affine = AffineDeformation(np.diag([1.25, 1.25, 0.64]), np.array([2.0, -1.0, 4.0]))
    meshed = MeshDeformation(ReferenceMesh(mesh.points, mesh.hexes()), compress(mesh.points))
    images = []
    for method in (MethodView(affine, VIEW), MethodView(meshed, VIEW)):
        deformed = deform_breast(method, mesh.points, 2.0)
        image, mask = project_breast(deformed, with_gland, method, 4)
        assert not mask[image == 0.0].any()
        assert image[mask].mean() > 10.0 * image[~mask].mean()
        excess = image - project_breast(deformed, without, method, 4)[0]
        rows, columns = np.indices(excess.shape) * 4.0 + 1.5
        centre = [(excess * columns).sum() / excess.sum(), (excess * rows).sum() / excess.sum()]
        assert centre == pytest.approx(VIEW.project(compress(np.array([0.0, -35.0, 10.0]))), abs=0.8)
        images.append(image)
    assert np.abs(images[0] - images[1]).mean() < 0.01
    assert images[0].max() > ATTENUATION_20KEV_PER_MM[1] * 0.9 * 2 * 48.0 * 0.64


def test_interpolation_beyond_a_grid_is_zero_and_inside_linear():
    samples = np.array([[1.0, 2.0, 4.0]], dtype=np.float32)
    got = interpolate_axis(samples, np.array([-0.6, -0.4, 0.5, 1.75, 2.4, 2.6]), 1)
    assert got[0] == pytest.approx([0.0, 1.0, 1.5, 3.5, 4.0, 0.0])
