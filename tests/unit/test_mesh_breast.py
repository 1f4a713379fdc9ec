"""The mesher on bodies with known geometry: required quality, place of the edges, invariances, bad input."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial import cKDTree

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.meshing.breast import build_mesh
from mammoreg.meshing.layout import first_mesh
from mammoreg.meshing.meridians import skin_meridians
from mammoreg.meshing.quality import scaled_jacobians
from mammoreg.meshing.relax import SquaredTerms, relax
from mammoreg.meshing.surface import breast_surface
from mammoreg.meshing.trilinear import GAUSS_POINTS, volumes
from tests.unit.breast_bodies import half_ellipsoid, pendulous, slab_on_bent_back
from tests.unit.test_mesh_block import bent_block

BODIES = {"half ellipsoid": half_ellipsoid, "pendulous": pendulous, "slab on bent back": slab_on_bent_back}


@pytest.fixture(scope="module", params=list(BODIES))
def body(request):
    return BODIES[request.param]()


@pytest.mark.parametrize("n", [5, 7])
def test_required_quality(body, n):
    quality = build_mesh(*body, n).quality
    assert quality.min_gauss_jacobian > 0.2
    assert quality.min_corner_jacobian > 0.05
    assert abs(quality.volume_error) < 0.02
    assert quality.surface_distance_mean_mm < 1.0
    assert quality.surface_distance_p95_mm < 3.0


def test_back_on_the_chest_wall_and_cap_around_the_nipple(body):
    mask, back, nipple = body
    mesh = build_mesh(mask, back, nipple, 7).mesh
    grid = mesh.points[mesh.node_grid()]
    gap, _ = cKDTree(back).query(grid[1:-1, 1:-1, 0].reshape(-1, 3))
    assert gap.max() < 2.5
    nearest = np.linalg.norm(mesh.points - nipple, axis=1).argmin()
    assert nearest in mesh.node_grid()[:, :, -1]


def test_volume_of_the_half_ellipsoid():
    mesh = build_mesh(*half_ellipsoid(), 7).mesh
    exact = 2.0 / 3.0 * np.pi * 60.0 * 75.0 * 50.0
    assert volumes(mesh.points[mesh.hexes()]).sum() == pytest.approx(exact, rel=0.015)


def test_long_edges_of_a_round_breast_lie_on_the_diagonals():
    mesh = build_mesh(*half_ellipsoid(55.0, 70.0, 55.0), 7).mesh
    grid = mesh.points[mesh.node_grid()]
    for i, j, degrees in [(-1, -1, 45.0), (0, -1, 135.0), (0, 0, -135.0), (-1, 0, -45.0)]:
        edge = grid[i, j, :-1]
        angle = np.rad2deg(np.arctan2(edge[:, 2], edge[:, 0]))
        np.testing.assert_allclose(angle, degrees, atol=6.0)


def test_mesh_moves_with_the_breast_and_repeats_itself():
    one = build_mesh(*half_ellipsoid(), 5).mesh.points
    again = build_mesh(*half_ellipsoid(), 5).mesh.points
    moved = build_mesh(*half_ellipsoid(centre=(-85.0, 31.0, 12.0)), 5).mesh.points
    assert one.tobytes() == again.tobytes()
    np.testing.assert_allclose(moved - [-85.0, 31.0, 12.0], one, atol=0.05)


def test_small_changes_of_the_mask_change_the_mesh_little():
    mask, back, nipple = half_ellipsoid()
    data = mask.data.copy()
    data[tuple(np.argwhere(data)[0])] = 0
    one = build_mesh(mask, back, nipple, 5).mesh.points
    other = build_mesh(mask.with_data(data), back, nipple, 5).mesh.points
    assert np.linalg.norm(other - one, axis=1).mean() < 0.7


def test_islands_and_holes_of_the_mask_do_not_matter():
    mask, back, nipple = half_ellipsoid()
    data = mask.data.copy()
    data[2:5, 2:5, 2:5] = 1
    middle = tuple(np.array(data.shape) // 2)
    data[middle] = 0
    quality = build_mesh(mask.with_data(data), back, nipple, 5).quality
    assert quality.min_gauss_jacobian > 0.2
    assert quality.surface_distance_p95_mm < 3.0


def test_first_mesh_already_lies_on_the_skin():
    mask, back, nipple = pendulous()
    surface = breast_surface(mask, back)
    mesh = first_mesh(skin_meridians(surface, nipple), 7)
    skin = mesh.points[np.setdiff1d(mesh.skin_nodes(), mesh.back_nodes())]
    distance, _ = cKDTree(surface.vertices).query(skin)
    assert distance.max() < 3.0


def test_relaxation_turns_inverted_elements_back():
    even, shaken = bent_block(4), bent_block(4, noise=9.0)
    border = np.union1d(even.skin_nodes(), even.back_nodes())
    shaken.points[border] = even.points[border]
    rows = (3 * border[:, None] + np.arange(3)).ravel()
    held = SquaredTerms(sparse.eye_array(even.points.size, format="csr")[rows], even.points[border].ravel())
    relaxed = relax(shaken, np.array([20.0, 22.0, 25.0]), held, 400)
    assert worst_jacobian(shaken) < 0.0
    assert worst_jacobian(relaxed) > 0.6
    np.testing.assert_allclose(relaxed.points[border], even.points[border], atol=0.5)


def worst_jacobian(mesh):
    return scaled_jacobians(mesh.points[mesh.hexes()], GAUSS_POINTS).min()


def test_an_empty_mask_is_refused():
    mask, back, nipple = half_ellipsoid()
    with pytest.raises(DataError, match="empty"):
        build_mesh(mask.with_data(mask.data * 0), back, nipple, 7)


def test_a_chest_wall_away_from_the_mask_is_refused():
    mask, back, nipple = half_ellipsoid()
    with pytest.raises(DataError, match="chest-wall surface"):
        build_mesh(mask, back + np.array([0.0, 60.0, 0.0]), nipple, 7)
    with pytest.raises(DataError, match="at least 25"):
        build_mesh(mask, back[:10], nipple, 7)


def test_a_block_needs_three_elements():
    mask = Volume(np.ones((3, 3, 3), dtype=np.uint8), np.zeros(3), np.ones(3))
    with pytest.raises(ValueError, match="at least 3"):
        build_mesh(mask, np.zeros((30, 3)), np.zeros(3), 2)
