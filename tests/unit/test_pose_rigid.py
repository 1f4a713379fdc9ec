"""Method `rigid`: parallel beams, nipple on nipple, else outline on outline."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.pose.outline import radial_outline
from mammoreg.pose.rigid import rigid_view
from mammoreg.pose.silhouette import detector_mm, quad_edges, ray_angles, silhouette
from tests.unit.block_meshes import half_ellipsoid

VIEW = ViewGeometry(30.0, -20.0, 1.0, -15.0, 45.0, 650.0, 15.0, 0.25, 800, 400)
MESH = half_ellipsoid(6)
QUADS = MESH.skin_quads().astype(np.intp)
NIPPLE = np.array([6.0, -74.0, -3.0])


def _outline(view: ViewGeometry):
    flat = detector_mm(breast_to_plate(MESH.points, view.angle_deg), view)
    points = silhouette(flat, quad_edges(QUADS), 0.0, ray_angles(361)).points()
    return radial_outline(points, np.clip(points[:, 0] / 10.0, 0.0, 1.0), ray_angles(181))


def test_nipples_coincide() -> None:
    seen = np.array([251.3, 377.9])
    view = rigid_view(MESH.points, QUADS, VIEW, _outline(VIEW), NIPPLE, seen)
    assert view.parallel
    assert view.project(breast_to_plate(NIPPLE, view.angle_deg)) == pytest.approx(seen, abs=1e-9)


def test_place_does_not_depend_on_the_start_when_the_nipple_is_seen() -> None:
    seen = np.array([251.3, 377.9])
    moved = replace(VIEW, edge_p_mm=-3.0, middle_mm=-9.0)
    one, other = (rigid_view(MESH.points, QUADS, v, _outline(VIEW), NIPPLE, seen) for v in (VIEW, moved))
    assert (one.edge_p_mm, one.middle_mm) == pytest.approx((other.edge_p_mm, other.middle_mm), abs=1e-9)


def test_outlines_coincide_where_no_nipple_is_seen() -> None:
    true = replace(VIEW, parallel=True)
    moved = replace(VIEW, edge_p_mm=VIEW.edge_p_mm + 8.0, middle_mm=VIEW.middle_mm - 6.0)
    found = rigid_view(MESH.points, QUADS, moved, _outline(true), NIPPLE, None)
    assert found.edge_p_mm == pytest.approx(VIEW.edge_p_mm, abs=0.2)
    assert found.middle_mm == pytest.approx(VIEW.middle_mm, abs=0.2)


def test_plates_lie_around_the_middle_of_the_breast_and_magnify_for_it() -> None:
    found = rigid_view(MESH.points, QUADS, VIEW, _outline(VIEW), NIPPLE, None)
    heights = breast_to_plate(MESH.points, VIEW.angle_deg)[:, 2]
    middle = 0.5 * (heights.min() + heights.max())
    assert found.height_mm + 0.5 * found.thickness_mm == pytest.approx(middle)
    assert found.magnification(np.array([-80.0, 80.0])) == pytest.approx([found.middle_magnification] * 2)
    assert found.angle_deg == VIEW.angle_deg
