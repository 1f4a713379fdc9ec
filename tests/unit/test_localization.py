"""Localisation against closed forms: affine deformations, spheres, straight beams, the clock face."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.geometry.frames import plate_rotation
from mammoreg.imaging.views import PROJECTIONS
from mammoreg.localization.anatomy import clock_position
from mammoreg.localization.deformation import AffineDeformation, MeshDeformation, MethodView, ReferenceMesh
from mammoreg.localization.grid import BreastGrid, BreastInView
from mammoreg.localization.lesions import LesionArea, area_from_disc, area_from_mask, body_from_mask, body_from_sphere
from mammoreg.localization.to_mammogram import project_landmarks, project_lesion
from mammoreg.localization.to_mr import back_projected_region, closest_approach, halfway, locate_in_breast
from mammoreg.meshing.block import BlockMesh

PIXEL_MM = 0.2


def view(angle_deg: float, *, parallel: bool = False, edge_p_mm: float = 0.0) -> ViewGeometry:
    return ViewGeometry(angle_deg, edge_p_mm, 0.0, -30.0, 60.0, 650.0, 15.0, PIXEL_MM, 900, 600, parallel)


def turned(angle_deg: float, shrink: float = 1.0) -> AffineDeformation:
    """Turn into the plate frame and shrink along the beam, volume kept."""
    wide = shrink**-0.5
    return AffineDeformation(np.diag([wide, wide, shrink]) @ plate_rotation(angle_deg), np.zeros(3))


def half_ball(radius: float = 60.0, spacing: float = 2.0) -> Volume:
    """Mask of a half ball in front (p < 0) of the origin, breast frame."""
    n = int(radius / spacing) + 2
    axis = np.arange(-n, n + 1) * spacing
    m, p, s = np.meshgrid(axis, axis, axis, indexing="ij")
    mask = (m**2 + p**2 + s**2 < radius**2) & (p <= 0)
    return Volume(mask, np.full(3, axis[0]), np.full(3, spacing))


def true_area(method: MethodView, centre: np.ndarray, diameter_mm: float) -> LesionArea:
    area = project_lesion(method, body_from_sphere(centre, diameter_mm)).area
    assert area is not None
    return area


GRID = BreastGrid(half_ball())


def both_views(shrink: float = 0.6) -> dict[str, MethodView]:
    return {
        "CC": MethodView(turned(0.0, shrink), view(0.0)),
        "MLO": MethodView(turned(45.0, shrink), view(45.0)),
    }


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(-0.2, 0.2), min_size=9, max_size=9),
    st.lists(st.floats(-40, 40), min_size=3, max_size=3),
)
def test_affine_inverse_undoes_forward(entries: list[float], offset: list[float]) -> None:
    deformation = AffineDeformation(np.eye(3) + np.reshape(entries, (3, 3)), np.array(offset))
    points = np.random.default_rng(0).uniform(-80, 80, (20, 3))
    np.testing.assert_allclose(deformation.inverse(deformation.forward(points)), points, atol=1e-9)


def box_mesh(n: int = 4, side: float = 40.0) -> BlockMesh:
    """A box; k counts from the back (p = 0) to the front (p = -side)."""
    axis = np.linspace(0, 1, n + 1)
    k, j, i = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([(i - 0.5) * side, -k * side, (j - 0.5) * side], axis=-1).reshape(-1, 3)
    return BlockMesh(n, points)


def bent(points: np.ndarray, bend: float) -> np.ndarray:
    """A smooth map with a closed form: each layer shifts with its depth, heights shrink."""
    m, p, s = points.T
    return np.stack([m + bend * np.sin(p / 20.0), p * 1.1, 0.7 * s], axis=1)


@settings(max_examples=15, deadline=None)
@given(st.floats(-4, 4), st.integers(0, 1000))
def test_mesh_inverse_undoes_forward_inside(bend: float, seed: int) -> None:
    mesh = box_mesh()
    deformation = MeshDeformation(ReferenceMesh(mesh.points, mesh.hexes()), bent(mesh.points, bend))
    points = np.random.default_rng(seed).uniform([-19, -39, -19], [19, -1, 19], (50, 3))
    np.testing.assert_allclose(deformation.inverse(deformation.forward(points)), points, atol=1e-4)


def test_mesh_deformation_is_exact_for_affine_nodes_and_nan_outside() -> None:
    mesh, affine = box_mesh(), turned(20.0, 0.7)
    deformation = MeshDeformation(ReferenceMesh(mesh.points, mesh.hexes()), affine.forward(mesh.points))
    points = np.random.default_rng(1).uniform([-19, -39, -19], [19, -1, 19], (200, 3))
    np.testing.assert_allclose(deformation.forward(points), affine.forward(points), atol=1e-6)
    just_outside = np.array([[20.5, -20.0, 0.0], [0.0, -41.0, 0.0]])
    np.testing.assert_allclose(deformation.forward(just_outside), affine.forward(just_outside), atol=1e-6)
    assert np.isnan(deformation.inverse(affine.forward(just_outside))).all()


def test_points_far_outside_the_mesh_stay_outside() -> None:
    mesh, turn = box_mesh(), turned(20.0)
    deformation = MeshDeformation(ReferenceMesh(mesh.points, mesh.hexes()), turn.forward(mesh.points))
    far = np.array([[0.0, 60.0, 5.0], [70.0, -10.0, 0.0], [-30.0, -80.0, -40.0]])
    np.testing.assert_allclose(deformation.forward(far), turn.forward(far), atol=1e-6)


def test_reference_mesh_asked_again_for_other_points_of_the_same_number() -> None:
    mesh = box_mesh()
    reference = ReferenceMesh(mesh.points, mesh.hexes())
    first, second = np.array([[1.0, -5.0, 2.0]]), np.array([[-7.0, -30.0, 4.0]])
    for points in (first, second, first):
        np.testing.assert_allclose(reference.carry(points, mesh.points), points, atol=1e-6)


def test_a_projected_sphere_is_a_disc_of_the_magnified_size() -> None:
    method = MethodView(turned(0.0), view(0.0))
    centre = np.array([7.0, -30.0, 0.0])
    lesion = project_lesion(method, body_from_sphere(centre, 10.0))
    assert lesion.area is not None
    assert lesion.seen
    expected = method.project(centre[None])[0]
    np.testing.assert_allclose(lesion.centre, expected, atol=0.3)
    area_mm2 = lesion.area.pixels * (PIXEL_MM / method.geometry.middle_magnification) ** 2
    assert area_mm2 == pytest.approx(np.pi * 25.0, rel=0.04)


def test_a_mask_of_coarse_voxels_projects_to_its_volumes_disc() -> None:
    axis = np.arange(-10, 11) * 1.4
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    mask = Volume(x**2 + y**2 + z**2 <= 36.0, np.array([-14.0, -44.0, -14.0]), np.full(3, 1.4))
    body = body_from_mask(mask)
    np.testing.assert_allclose(body.centre, [0.0, -30.0, 0.0], atol=1e-9)
    method = MethodView(turned(0.0), view(0.0))
    lesion = project_lesion(method, body)
    assert lesion.area is not None
    assert lesion.area.pixels * (PIXEL_MM / method.geometry.middle_magnification) ** 2 == pytest.approx(
        np.pi * 36.0, rel=0.06
    )
    rows, columns = np.nonzero(lesion.area.mask)
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), abs=2)


def test_lesion_of_a_single_voxel_keeps_its_place() -> None:
    data = np.zeros((5, 5, 5))
    data[2, 2, 2] = 1
    body = body_from_mask(Volume(data, np.zeros(3), np.array([1.0, 2.0, 3.0])))
    assert len(body.points) > 0
    np.testing.assert_allclose(body.points.mean(axis=0), [2.0, 4.0, 6.0], atol=1e-9)


def test_what_lies_behind_the_edge_is_not_seen() -> None:
    method = MethodView(turned(0.0), view(0.0, edge_p_mm=-20.0))
    depths = (-21.0, -20.05, -19.5, -18.5, -17.5, -300.0)
    pixels, seen = project_landmarks(method, np.array([[0.0, depth, 0.0] for depth in depths]))
    assert seen.tolist() == [True, True, False, False, False, False]
    assert (pixels[seen] >= -0.5).all(), "what is seen lies on a column of the image"
    behind = project_lesion(method, body_from_sphere(np.array([0.0, -5.0, 0.0]), 8.0))
    assert behind.area is None
    assert not behind.seen
    across = project_lesion(method, body_from_sphere(np.array([0.0, -17.0, 0.0]), 8.0))
    assert across.area is not None
    assert not across.seen
    assert across.area.first[0] == 0


@pytest.mark.parametrize("centre", [[0.0, -25.0, 0.0], [15.0, -30.0, -12.0], [-20.0, -20.0, 10.0]])
@pytest.mark.parametrize("diameter", [4.0, 12.0])
def test_two_views_give_back_the_sphere(centre: list[float], diameter: float) -> None:
    methods = both_views()
    areas = {name: true_area(method, np.array(centre), diameter) for name, method in methods.items()}
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    assert found.message == ""
    assert found.region is not None
    assert found.beam_gap_mm is not None
    assert found.beam_gap_mm < 0.3
    np.testing.assert_allclose(found.point, centre, atol=0.5)
    cells = found.region.centres(found.region.data)
    radius = np.linalg.norm(cells - centre, axis=1)
    ball = np.pi / 6 * diameter**3
    covered = np.count_nonzero(radius <= 0.5 * diameter) * found.region.voxel_mm3
    assert covered == pytest.approx(ball, rel=0.12)
    assert len(cells) * found.region.voxel_mm3 < 2.2 * ball


def of_views(*names: str) -> dict[str, MethodView]:
    angles = {name: PROJECTIONS[name].angle_deg + 4.0 for name in names}
    return {name: MethodView(turned(angle, 0.6), view(angle)) for name, angle in angles.items()}


@pytest.mark.parametrize(
    "names", [("CC", "ML"), ("CC", "LM"), ("MLO", "LM"), ("LMO", "FB"), ("XCCL", "MLO"), ("CC", "MLO", "ML", "LMO")]
)
def test_any_views_that_cross_give_back_the_sphere(names: tuple[str, ...]) -> None:
    methods, centre = of_views(*names), np.array([15.0, -30.0, -12.0])
    areas = {name: true_area(method, centre, 10.0) for name, method in methods.items()}
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    assert found.message == ""
    np.testing.assert_allclose(found.point, centre, atol=0.5)


@pytest.mark.parametrize("names", [("CC", "FB"), ("ML", "LM"), ("MLO", "LMO"), ("CC", "XCCM")])
def test_beams_that_run_alike_say_that_the_depth_is_uncertain(names: tuple[str, ...]) -> None:
    methods, centre = of_views(*names), np.array([15.0, -30.0, -12.0])
    areas = {name: true_area(method, centre, 10.0) for name, method in methods.items()}
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    assert "hardly determine the depth" in found.message
    across = found.point - centre
    along = next(iter(methods.values())).deformation.matrix[2]
    along = along / np.linalg.norm(along)
    assert np.linalg.norm(across - along * (across @ along)) < 3.0


def test_of_three_beams_the_two_that_cross_best_give_the_middle() -> None:
    methods = of_views("CC", "FB", "ML")
    places = {"CC": [0.0, -30.0, 0.0], "FB": [0.0, -30.0, 0.0], "ML": [0.0, -40.0, 0.0]}
    areas = {name: true_area(method, np.array(places[name]), 6.0) for name, method in methods.items()}
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    assert found.region is None
    assert found.beam_gap_mm == pytest.approx(10.0, abs=0.3)
    np.testing.assert_allclose(found.point, [0.0, -35.0, 0.0], atol=0.6)


@pytest.mark.parametrize("shrink", [1.0, 0.5])
def test_region_holds_every_cell_that_appears_in_both_lesions(shrink: float) -> None:
    """A coarse cell is passed over only where none of its parts can lie in the lesion, also where tissue spreads."""
    views = {n: BreastInView(m, BreastGrid(half_ball(32.0, 4.0))) for n, m in both_views(shrink).items()}
    for centre in np.random.default_rng(3).uniform([-15.0, -20.0, -15.0], [15.0, -8.0, 15.0], (6, 3)):
        areas = {name: true_area(view.method, centre, 5.0) for name, view in views.items()}
        region = back_projected_region([(views[name], areas[name]) for name in views])
        assert region is not None
        near = np.stack(np.meshgrid(*3 * [np.arange(-9.0, 9.01, region.spacing[0])], indexing="ij"), axis=-1)
        middle = region.origin + np.rint((centre - region.origin) / region.spacing) * region.spacing
        cells = middle + near.reshape(-1, 3)
        cells = cells[views["CC"].grid.holds(cells)]
        seen = np.all([a.contains(views[n].method.project(cells)) for n, a in areas.items()], axis=0)
        held = int(np.count_nonzero(region.data))
        assert held == seen.sum()


def test_a_tiny_lesion_on_a_sharp_grid_is_found() -> None:
    methods = both_views()
    centre = np.array([3.0, -35.0, 5.0])
    areas = {}
    for name, method in methods.items():
        column, row = method.project(centre[None])[0]
        areas[name] = area_from_disc(float(column), float(row), 10.0)
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    np.testing.assert_allclose(found.point, centre, atol=0.4)


def test_beams_that_miss_each_other_meet_midway() -> None:
    methods = both_views()
    low, high = np.array([0.0, -30.0, 0.0]), np.array([0.0, -40.0, 0.0])
    areas = {"CC": true_area(methods["CC"], low, 6.0), "MLO": true_area(methods["MLO"], high, 6.0)}
    found = locate_in_breast({n: BreastInView(m, GRID) for n, m in methods.items()}, areas)
    assert found.region is None
    assert "do not meet" in found.message
    assert found.beam_gap_mm == pytest.approx(10.0, abs=0.3)
    np.testing.assert_allclose(found.point, 0.5 * (low + high), atol=0.6)


def test_one_view_gives_the_curve_and_its_middle() -> None:
    method = MethodView(turned(0.0), view(0.0, parallel=True))
    centre = np.array([10.0, -30.0, 20.0])
    found = locate_in_breast({"CC": BreastInView(method, GRID)}, {"CC": true_area(method, centre, 8.0)})
    assert found.beam_gap_mm is None
    curve = found.curves["CC"]
    assert np.abs(curve[:, :2] - centre[:2]).max() < 2.0
    assert np.ptp(curve[:, 2]) == pytest.approx(2 * np.sqrt(60.0**2 - 30.0**2 - 10.0**2), abs=3.0)
    assert found.point[2] == pytest.approx(0.0, abs=1.0)
    assert found.message.startswith("one view does not determine the depth of the lesion")
    (length,) = (float(word) for word in found.message.split() if word.isdigit())
    assert length == pytest.approx(np.ptp(curve[:, 2]), abs=1.0)


def test_a_beam_beside_the_breast_uses_the_nearest_part() -> None:
    method = MethodView(turned(0.0), view(0.0))
    column, row = method.project(np.array([[0.0, -68.0, 0.0]]))[0]
    found = locate_in_breast(
        {"CC": BreastInView(method, GRID)}, {"CC": area_from_disc(float(column), float(row), 15.0)}
    )
    assert "misses" in found.message
    assert found.point[1] == pytest.approx(-59.0, abs=3.0)


def test_closest_approach_of_skew_lines() -> None:
    parameter = np.linspace(-30.0, 31.0, 123)[:, None]
    first = np.array([0.0, 0.0, 0.0]) + parameter * np.array([1.0, 0.0, 0.0])
    second = np.array([4.2, 0.0, 7.0]) + parameter * np.array([0.0, 1.0, 0.0])
    point, gap = closest_approach(first, second)
    assert gap == pytest.approx(7.0, abs=1e-3)
    np.testing.assert_allclose(point, [4.2, 0.0, 3.5], atol=0.02)


def test_halfway_follows_length_not_vertices() -> None:
    curve = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    np.testing.assert_allclose(halfway(curve), [5.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("step", "right", "left"),
    [
        ((0.0, 20.0), "12:00", "12:00"),
        ((20.0, 0.0), "3:00", "9:00"),  # medial
        ((-20.0, 0.0), "9:00", "3:00"),  # lateral
        ((0.0, -20.0), "6:00", "6:00"),
        ((-20.0, 20.0), "10:30", "1:30"),  # upper outer quadrant
        ((-5.3, 20.0), "11:30", "12:30"),
        ((1.0, 2.0), "central", "central"),
    ],
)
def test_clock_facing_the_patient(step: tuple[float, float], right: str, left: str) -> None:
    nipple = np.array([50.0, -80.0, 3.0])
    point = nipple + np.array([step[0], 30.0, step[1]])
    assert clock_position(point, nipple, "R") == right
    assert clock_position(point, nipple, "L") == left


@pytest.mark.parametrize("diameter", [0.0, -1.0, float("nan")])
def test_a_lesion_needs_a_size(diameter: float) -> None:
    with pytest.raises(ValueError, match="diameter"):
        body_from_sphere(np.zeros(3), diameter)
    with pytest.raises(ValueError, match="diameter"):
        area_from_disc(10.0, 10.0, diameter)


def test_empty_masks_are_refused() -> None:
    with pytest.raises(ValueError, match="empty"):
        body_from_mask(Volume(np.zeros((3, 3, 3)), np.zeros(3), np.ones(3)))
    with pytest.raises(ValueError, match="empty"):
        area_from_mask(np.zeros((4, 4), dtype=bool))


def test_area_centre_membership_and_border() -> None:
    image = np.zeros((30, 40), dtype=bool)
    image[4:7, 10:20] = True
    area = area_from_mask(image)
    np.testing.assert_allclose(area.centre, [14.5, 5.0])
    np.testing.assert_array_equal(area.on_image(30, 40), image)
    assert area.contains(np.array([[10.0, 4.0], [9.4, 4.0], [19.4, 6.4], [500.0, 4.0]])).tolist() == [
        True,
        False,
        True,
        False,
    ]
    outside = LesionArea(np.ones((3, 3), dtype=bool), (-2, -2))
    assert outside.on_image(30, 40).sum() == 1
    assert not LesionArea(np.ones((3, 3), dtype=bool), (50, 50)).on_image(30, 40).any()
