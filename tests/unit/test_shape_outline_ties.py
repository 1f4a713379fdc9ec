"""A compressed breast drawn to an outline."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import back_condition
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.geometry import ViewGeometry
from mammoreg.materials.elastic import neo_hookean
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.alignment import measure
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import detector_mm, quad_edges, ray_angles, silhouette
from mammoreg.shape.estimate import ShapeEstimate, estimate_shape
from mammoreg.shape.outline_ties import outline_ties
from tests.unit.block_meshes import half_ellipsoid

MESH = half_ellipsoid(4, (55.0, 75.0, 45.0))
FACES = MESH.skin_quads()
FACETS = skin_facets(FACES, len(MESH.points), 3)
EDGE, GAP, WIDER_MM = -12.0, 54.0, 3.0


def _closing() -> Closing:
    model = HyperelasticModel(MESH.points, MESH.hexes(), neo_hookean(9.4, 0.495))
    back = back_condition("slide_compression", MESH.points, MESH.back_quads(), along_kpa_per_mm=0.25)
    return Closing(model, FACES, back, EDGE, 8.0, 0.3, ClosingOptions(steps=5))


@pytest.fixture(scope="module")
def closing() -> Closing:
    return _closing()


@pytest.fixture(scope="module")
def closed(closing: Closing) -> Closed:
    return closing.close(GAP)


def _view(closed: Closed) -> ViewGeometry:
    return ViewGeometry(0.0, EDGE, 0.0, closed.height_mm, GAP, 650.0, 15.0, 0.2, 900, 500)


def _moved_outline(closed: Closed, normal_mm: float, weight: np.ndarray | None = None) -> RadialOutline:
    """The silhouette, moved along its normal by so much at the middle of the plates, with trust fading to the edge."""
    view = _view(closed)
    flat = detector_mm(FACETS.positions(closed.deformed), view)
    points = silhouette(flat, quad_edges(FACETS.quads), 0.0, ray_angles(361)).points()
    tangent = np.gradient(points, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    trust = np.clip(points[:, 0] / 10.0, 0.0, 1.0) if weight is None else weight
    return radial_outline(points + normal_mm * view.middle_magnification * normal, trust, ray_angles(181))


def _drawn(closing: Closing, closed: Closed, outline: RadialOutline, rounds: int = 4) -> ShapeEstimate:
    return estimate_shape(closing, closed, FACES, FACETS, _view(closed), outline, 20.0, rounds, 0.1)


@pytest.fixture(scope="module")
def wider(closing: Closing, closed: Closed) -> ShapeEstimate:
    return _drawn(closing, closed, _moved_outline(closed, WIDER_MM))


def test_silhouette_reaches_a_wider_outline(wider: ShapeEstimate) -> None:
    full = wider.before.weight > 0.99
    assert wider.before.gap_mm[full].mean() == pytest.approx(WIDER_MM, abs=0.4)
    assert np.abs(wider.after.gap_mm[full]).mean() < 0.2
    assert np.quantile(np.abs(wider.after.gap_mm[full]), 0.95) < 0.6


def test_nothing_is_drawn_where_the_rim_makes_the_silhouette(closed: Closed) -> None:
    """The upper half of the skin and the cap, as if the model ended at the sides: there its open edge is no skin."""
    middle = MESH.points[FACES].mean(axis=1)
    upper = FACES[(middle[:, 2] > 0.0) | (middle[:, 1] < -55.0)]
    facets = skin_facets(upper, len(MESH.points), 3)
    outline = _moved_outline(closed, WIDER_MM)
    nodes, view = closed.deformed, replace(_view(closed), edge_p_mm=EDGE)
    blind = measure(facets.positions(nodes), facets.quads, view, outline)
    state = measure(facets.positions(nodes), facets.quads, view, outline, facets.rim)
    lost = blind.weight > state.weight
    assert lost.any()
    assert facets.rim[blind.model.edge_nodes[lost]].all()
    assert (state.weight > 0.0).sum() > 20
    _, rays = outline_ties(nodes, upper, facets, view, outline, 100.0)
    np.testing.assert_array_equal(rays, np.flatnonzero(state.weight > 0.0))


def test_silhouette_reaches_a_narrower_outline(closing: Closing, closed: Closed) -> None:
    """Skin that is drawn inwards leaves the silhouette to other skin, which must not take turns with it."""
    found = _drawn(closing, closed, _moved_outline(closed, -2.0))
    full = found.before.weight > 0.99
    assert found.before.gap_mm[full].mean() == pytest.approx(-2.0, abs=0.4)
    assert np.abs(found.after.gap_mm[full]).mean() < 0.2
    assert np.quantile(np.abs(found.after.gap_mm[full]), 0.95) < 0.6
    assert found.closed.volume_change == pytest.approx(closed.volume_change, abs=0.005)


def test_more_rounds_are_never_worse(closing: Closing, closed: Closed) -> None:
    outline = _moved_outline(closed, -4.0)
    means = [np.abs(_drawn(closing, closed, outline, n).after.gap_mm[outline.weight > 0.99]).mean() for n in range(5)]
    assert (np.diff(means) <= 0.0).all()
    assert means[-1] < 0.15 * means[0]


def test_contact_faces_stay_on_the_plates(closed: Closed, wider: ShapeEstimate) -> None:
    height = closed.deformed[:, 2] - closed.height_mm
    touching = ((height < 1.0) | (height > GAP - 1.0)) & (closed.deformed[:, 1] < EDGE - 8.0)
    assert touching.sum() >= 5
    after = wider.closed.deformed[:, 2] - wider.closed.height_mm
    moved = np.abs(after - height)[touching]
    assert np.median(moved) < 0.1
    assert moved.max() < 1.0
    front = wider.closed.deformed[:, 1] < EDGE - 10.0
    assert after[front].min() > -0.5
    assert after[front].max() < GAP + 0.5


def test_volume_is_kept_and_no_element_turns_over(wider: ShapeEstimate) -> None:
    assert abs(wider.closed.volume_change) < 0.01
    assert wider.closed.min_det_f > 0.3


def test_plates_stay_at_the_height_that_the_image_knows(closed: Closed, wider: ShapeEstimate) -> None:
    assert wider.closed.height_mm == closed.height_mm
    forces = wider.closed.force_n
    assert forces[0] == pytest.approx(forces[1], rel=0.15), "ties pull across, hardly towards one plate"


def test_matching_outline_changes_nothing(closing: Closing, closed: Closed) -> None:
    found = _drawn(closing, closed, _moved_outline(closed, 0.0))
    assert found.rounds == 0
    np.testing.assert_array_equal(found.closed.deformed, closed.deformed)


def test_no_rounds_change_nothing(closing: Closing, closed: Closed) -> None:
    found = _drawn(closing, closed, _moved_outline(closed, WIDER_MM), rounds=0)
    np.testing.assert_array_equal(found.closed.deformed, closed.deformed)


def test_where_the_outline_is_not_trusted_nothing_is_pulled(closing: Closing, closed: Closed) -> None:
    """Trusted on the medial side alone, the outline leaves the lateral side where it was."""
    weight = np.clip(ray_angles(361) / 0.3, 0.0, 1.0)
    outline = _moved_outline(closed, WIDER_MM, weight)
    ties, rays = outline_ties(closed.deformed, FACES, FACETS, _view(closed), outline, 100.0)
    np.testing.assert_array_equal(rays, np.flatnonzero(outline.weight > 0.0))
    assert len(ties.nodes) == len(rays)
    found = _drawn(closing, closed, outline)
    free, full = ray_angles(181) < -0.5, outline.weight > 0.99
    assert np.abs(found.after.gap_mm[full]).mean() < 0.3
    moved = found.after.model.radius - found.before.model.radius
    assert np.abs(moved[free]).max() < 0.5 * moved[full].mean()


def test_stiffness_is_that_of_the_outlines_length_times_its_trust(closed: Closed) -> None:
    outline = _moved_outline(closed, WIDER_MM)
    ties, _ = outline_ties(closed.deformed, FACES, FACETS, _view(closed), outline, 100.0)
    points = outline.points()
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    between = 0.5 * (outline.weight[1:] + outline.weight[:-1])
    assert ties.stiffness.sum() == pytest.approx(100.0 * float(np.nansum(length * between)), rel=0.02)


@pytest.mark.parametrize("parallel", [False, True])
def test_ties_pull_along_the_slope_of_the_projected_place(closed: Closed, parallel: bool) -> None:
    """Finite differences of the cone beam; the advance is what closes the gap to first order."""
    view = replace(_view(closed), parallel=parallel)
    outline = _moved_outline(closed, WIDER_MM)
    ties, rays = outline_ties(closed.deformed, FACES, FACETS, view, outline, 100.0)
    state = measure(FACETS.positions(closed.deformed), FACETS.quads, view, outline)
    normal = outline.normal[rays]
    points = ties.points(closed.deformed)

    def place(at: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("ti,ti->t", detector_mm(at, view), normal))

    step = 1e-3
    slope = np.stack([(place(points + e) - place(points - e)) / (2 * step) for e in step * np.eye(3)], axis=-1)
    steep = np.linalg.norm(slope, axis=1)
    np.testing.assert_allclose(ties.direction, slope / steep[:, None], atol=1e-6)
    reached = points - ties.distance(closed.deformed)[:, None] * ties.direction
    gap = state.gap_mm[rays] * view.middle_magnification
    np.testing.assert_allclose(place(reached) - place(points), gap, atol=0.02)


def test_tied_points_make_the_silhouette(closed: Closed) -> None:
    view, outline = _view(closed), _moved_outline(closed, WIDER_MM)
    ties, rays = outline_ties(closed.deformed, FACES, FACETS, view, outline, 100.0)
    points = ties.points(closed.deformed)
    np.testing.assert_allclose(ties.shape.sum(axis=1), 1.0)
    assert ties.shape.min() >= 0.0
    seen = detector_mm(points, view)
    model = measure(FACETS.positions(closed.deformed), FACETS.quads, view, outline).model
    np.testing.assert_allclose(seen, model.points()[rays], atol=0.1)
