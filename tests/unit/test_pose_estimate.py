"""Search for the pose with a compression that is a formula: pressed flat, widened alike, volume kept."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.meshing.locate import Locator
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.density import DensityImage, mammogram_structure
from mammoreg.pose.estimate import Compressed, DenseTissue, PoseEstimate, estimate_pose
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import detector_mm, ray_angles
from tests.unit.block_meshes import half_ellipsoid

VIEW = ViewGeometry(0.0, -15.0, 0.0, 0.0, 60.0, 650.0, 15.0, 1.0, 200, 130)
LONG, ROUND = (60.0, 85.0, 45.0), (55.0, 85.0, 55.0)  # half axes, mm: the first's shadow depends on the angle
BLOBS = np.array([[18.0, -45.0, 24.0], [-20.0, -50.0, -22.0], [5.0, -60.0, -25.0]])
OFF = np.array([0.0, 7.0, -4.0])  # what the pose has to find: the breast's place in the image


def breast(half_axes: tuple[float, float, float]):
    return half_ellipsoid(6, half_axes)


@dataclass
class Press:
    """The compression as the search calls it; `fails` tells at which angles it does not converge."""

    points: np.ndarray
    fails: Callable[[float], bool] = lambda angle: False
    angles: list[float] = field(default_factory=list)

    def __call__(self, view: ViewGeometry) -> Compressed | None:
        self.angles.append(view.angle_deg)
        if self.fails(view.angle_deg):
            return None
        return Compressed(pressed(self.points, view.angle_deg), -0.5 * VIEW.thickness_mm)


def pressed(points: np.ndarray, angle_deg: float) -> np.ndarray:
    turned = breast_to_plate(points, angle_deg)
    share = VIEW.thickness_mm / 100.0
    return turned * [share**-0.5, share**-0.5, share] + OFF


@cache
def taken(half_axes: tuple[float, float, float], angle_deg: float) -> tuple[RadialOutline, DensityImage]:
    """What a mammogram at an angle shows: an outline, and the shadow of dense balls by many small grains."""
    mesh = breast(half_axes)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), 4)
    view = replace(VIEW, angle_deg=angle_deg, height_mm=-0.5 * VIEW.thickness_mm)
    model = radial_outline(np.array([[1.0, -1.0], [1.0, 1.0]]), np.ones(2), ray_angles(361))
    flat = detector_mm(facets.positions(pressed(mesh.points, angle_deg)), view)
    points = model.of_model(flat, facets.quads).points()
    points = points[np.isfinite(points).all(axis=1)]
    outline = radial_outline(points, np.clip(points[:, 0] / 10.0, 0.0, 1.0), ray_angles(181))
    column, row = np.moveaxis(view.project(pressed(_grains(), angle_deg)), -1, 0)
    image, _, _ = np.histogram2d(row, column, bins=(np.arange(-0.5, 200), np.arange(-0.5, 130)))
    r, c = np.mgrid[0:200, 0:130]
    radius = np.interp(np.arctan2(r - 99.5, c + 0.5), outline.theta, np.nan_to_num(outline.radius))
    return outline, mammogram_structure(image.astype(np.float32), np.hypot(r - 99.5, c + 0.5) < radius, 1.0)


def _grains() -> np.ndarray:
    axis = np.arange(-9.0, 9.1, 1.0)
    ball = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = ball[np.linalg.norm(ball, axis=1) < 9.0]
    return (BLOBS[:, None] + ball).reshape(-1, 3)


@cache
def tissue_of(half_axes: tuple[float, float, float]) -> DenseTissue:
    mesh = breast(half_axes)
    axis = np.arange(-90.0, 90.1, 3.0)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    element, local, inside = Locator(mesh.points, mesh.hexes()).locate(grid)
    excess = (np.linalg.norm(grid[inside, None] - BLOBS, axis=2).min(axis=1) < 9.0).astype(float)
    return DenseTissue(mesh.hexes(), element[inside], local[inside], excess)


def search(
    half_axes: tuple[float, float, float],
    true_deg: float,
    press: Press | None = None,
    *,
    dense: bool = True,
    step: float = 4.0,
    bound: float = 16.0,
    prior_sd: float = 5.0,
) -> PoseEstimate | None:
    mesh = breast(half_axes)
    outline, image = taken(half_axes, true_deg)
    return estimate_pose(
        VIEW,
        outline,
        press or Press(mesh.points),
        skin_facets(mesh.skin_quads(), len(mesh.points), 2),
        step,
        bound,
        prior_sd,
        tissue_of(half_axes) if dense else None,
        image if dense else None,
    )


@pytest.mark.parametrize("true_deg", [-7.0, 0.0, 5.0])
def test_angle_and_place_are_found(true_deg: float) -> None:
    found = search(LONG, true_deg)
    assert found is not None
    assert found.determined
    assert not found.at_bound
    assert found.view.angle_deg == pytest.approx(true_deg, abs=1.0)
    assert found.view.edge_p_mm == pytest.approx(VIEW.edge_p_mm, abs=0.5)
    assert found.view.middle_mm == pytest.approx(VIEW.middle_mm, abs=1.0)
    assert found.alignment.rms_mm < 0.5


@pytest.mark.parametrize("factor", [0.8, 0.85, 1.0, 1.15])
def test_a_wrong_pixel_spacing_shows_in_the_size(factor: float) -> None:
    """An outline `factor` times its true size, though edge and middle may move to hide it."""
    mesh, (outline, _) = breast(LONG), taken(LONG, 0.0)
    shown = replace(outline, radius=factor * outline.radius, centre_along_mm=factor * outline.centre_along_mm)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), 2)
    found = estimate_pose(VIEW, shown, Press(mesh.points), facets, 0.0, 16.0, 5.0)
    assert found is not None
    assert found.size == pytest.approx(1.0 / factor, rel=0.02)


def test_dense_tissue_tells_what_the_outline_of_a_round_breast_cannot() -> None:
    blind, seeing = search(ROUND, 6.0, dense=False), search(ROUND, 6.0)
    assert blind is not None
    assert seeing is not None
    assert seeing.view.angle_deg == pytest.approx(6.0, abs=1.0)
    assert seeing.determined
    assert abs(blind.view.angle_deg - 6.0) > 2.0


def test_angle_that_nothing_tells_stays_the_headers_and_is_marked() -> None:
    mesh = half_ellipsoid(6, ROUND)
    upright = Press(mesh.points)
    outline, _ = taken(ROUND, 0.0)
    found = estimate_pose(
        VIEW,
        outline,
        lambda view: upright(replace(view, angle_deg=0.0)),  # a body of revolution looks alike at every angle
        skin_facets(mesh.skin_quads(), len(mesh.points), 2),
        4.0,
        16.0,
        5.0,
    )
    assert found is not None
    assert found.view.angle_deg == VIEW.angle_deg
    assert not found.determined
    assert found.angle_sd_deg == pytest.approx(5.0, rel=0.1), "the prior's"


def test_angle_beyond_the_bound_ends_there_and_is_marked() -> None:
    found = search(LONG, 14.0, bound=8.0, prior_sd=20.0)
    assert found is not None
    assert found.at_bound
    assert found.view.angle_deg == pytest.approx(8.0, abs=0.5)


def test_narrow_prior_keeps_the_angle_near_the_header() -> None:
    wide, narrow = search(LONG, 8.0), search(LONG, 8.0, prior_sd=0.5)
    assert wide is not None
    assert narrow is not None
    assert abs(narrow.view.angle_deg) < 0.6 * abs(wide.view.angle_deg)
    assert not narrow.determined


def test_step_of_zero_keeps_the_headers_angle() -> None:
    press = Press(breast(LONG).points)
    found = search(LONG, 6.0, press, step=0.0)
    assert found is not None
    assert set(press.angles) == {0.0}
    assert (found.view.angle_deg, found.determined, found.at_bound) == (0.0, False, False)


def test_angles_that_do_not_converge_are_passed_over() -> None:
    press = Press(breast(LONG).points, fails=lambda angle: angle == -4.0)
    found = search(LONG, 5.0, press)
    assert found is not None
    assert found.view.angle_deg == pytest.approx(5.0, abs=1.0)
    assert press.angles.count(-4.0) == 1


@pytest.mark.parametrize("true_deg", [5.0, -5.0])
def test_where_one_side_never_converges_the_search_ends_at_a_converged_angle(true_deg: float) -> None:
    press = Press(breast(LONG).points, fails=lambda angle: angle > 0.0)
    found = search(LONG, true_deg, press)
    assert found is not None
    assert found.view.angle_deg <= 0.0
    assert len(press.angles) < 12


def test_headers_angle_alone_may_fail() -> None:
    press = Press(breast(LONG).points, fails=lambda angle: angle == 0.0)
    found = search(LONG, 4.0, press)
    assert found is not None
    assert found.view.angle_deg == pytest.approx(4.0, abs=1.5)


def test_nothing_converges() -> None:
    press = Press(breast(LONG).points, fails=lambda angle: True)
    assert search(LONG, 0.0, press) is None
    assert len(press.angles) < 12


def test_candidates_tell_the_models_rim_from_skin() -> None:
    """A back that bends forward at the sides ends in front of the image's edge, where the outline goes on."""
    mesh, whole = breast(LONG), search(LONG, 0.0, dense=False)
    bent = mesh.points + [0.0, -60.0, 0.0] * (mesh.points[:, :1] / LONG[0]) ** 2
    found = search(LONG, 0.0, Press(bent), dense=False)
    assert whole is not None
    assert found is not None
    assert {c.rim_share for c in whole.candidates} == {0.0}
    assert all(c.skin.rms_mm == c.alignment.rms_mm for c in whole.candidates)
    for candidate in found.candidates:
        assert 0.05 < candidate.rim_share < 0.5
        assert abs(candidate.skin.rms_mm - candidate.alignment.rms_mm) > 0.5


def test_a_wide_gap_on_a_few_rays_counts_by_its_size_in_the_misfit_too() -> None:
    """As in the alignment: the model's rim comes into sight at some angles and not at their neighbours."""
    whole = Press(breast(LONG).points)

    def with_a_flap(view: ViewGeometry) -> Compressed | None:
        nodes = pressed(whole.points, view.angle_deg)
        flap = (nodes[:, 0] > 40.0) & (np.abs(nodes[:, 1] + 30.0) < 14.0) & (view.angle_deg > 2.0)
        return Compressed(nodes + np.outer(flap, [40.0, 0.0, 0.0]), -0.5 * VIEW.thickness_mm)

    facets = skin_facets(breast(LONG).skin_quads(), len(whole.points), 2)
    found = estimate_pose(VIEW, taken(LONG, 6.0)[0], with_a_flap, facets, 4.0, 16.0, 5.0)
    assert found is not None
    at = {c.angle_deg: c for c in found.candidates}
    gap, weight = np.abs(np.nan_to_num(at[4.0].alignment.gap_mm)), at[4.0].alignment.weight
    loss = np.average(np.where(gap < 4.0, gap**2, 8.0 * gap - 16.0), weights=weight)
    assert at[4.0].misfit == pytest.approx(6.0 * np.log(loss + 1.0) + (4.0 / 5.0) ** 2)
    assert at[4.0].alignment.rms_mm > 1.4 * np.sqrt(loss)
    assert at[0.0].alignment.robust_mm == at[0.0].alignment.rms_mm
