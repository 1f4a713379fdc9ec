"""Thickness from the outline, with an ellipsoid that widens as its plates close."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial import ConvexHull

from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.estimate import Compressed
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import detector_mm, quad_edges, ray_angles, silhouette
from mammoreg.pose.thickness import estimate_thickness

HEIGHT = 100.0
VIEW = ViewGeometry(0.0, 20.0, 0.0, 0.0, 60.0, 650.0, 15.0, 0.2, 900, 600)


def ellipsoid() -> tuple[np.ndarray, SkinFacets]:
    """Vertices of an ellipsoid with half axes 60, 80, 50 mm, and its facets."""
    axis = np.linspace(-1.0, 1.0, 21)
    cube = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    shell = cube[np.abs(cube).max(axis=1) > 0.999]
    shell /= np.linalg.norm(shell, axis=1, keepdims=True)
    quads = ConvexHull(shell).simplices[:, [0, 1, 2, 2]].astype(np.intp)
    closed = np.zeros(len(shell), dtype=bool)
    return shell * [60.0, 80.0, 50.0], SkinFacets(sparse.csr_array(sparse.eye_array(len(shell))), quads, closed)


def pressed(points: np.ndarray, view: ViewGeometry) -> Compressed:
    """The ellipsoid between plates, its volume kept and its middle where it was."""
    share = view.thickness_mm / HEIGHT
    return Compressed(points * [share**-0.5, share**-0.5, share], -0.5 * view.thickness_mm)


def outline_of(points: np.ndarray, facets: SkinFacets, share: float) -> RadialOutline:
    view = replace(VIEW, thickness_mm=share * HEIGHT, height_mm=-0.5 * share * HEIGHT)
    flat = detector_mm(pressed(points, view).nodes, view)
    shadow = silhouette(flat, quad_edges(facets.quads), 0.0, ray_angles(361)).points()
    return radial_outline(shadow, np.clip(shadow[:, 0] / 10.0, 0.0, 1.0), ray_angles(181))


@pytest.mark.parametrize("share", [0.5, 0.62, 0.75])
def test_thickness_is_recovered_within_the_aim(share: float) -> None:
    points, facets = ellipsoid()
    found = estimate_thickness(
        VIEW, outline_of(points, facets, share), lambda view: pressed(points, view), facets, HEIGHT
    )
    assert found is not None
    assert found.thickness_mm == pytest.approx(share * HEIGHT, rel=0.1)
    assert not found.at_bound


@pytest.mark.parametrize(("share", "bound"), [(0.95, 0.8), (0.3, 0.4)])
def test_what_ends_at_the_bound_of_the_search_is_marked(share: float, bound: float) -> None:
    """The outline of a breast that is pressed less, or more, than any gap tried."""
    points, facets = ellipsoid()
    found = estimate_thickness(
        VIEW, outline_of(points, facets, share), lambda view: pressed(points, view), facets, HEIGHT
    )
    assert found is not None
    assert found.thickness_mm == pytest.approx(bound * HEIGHT)
    assert found.at_bound


def test_failed_compressions_are_left_out_and_too_few_give_no_answer() -> None:
    points, facets = ellipsoid()
    outline = outline_of(points, facets, 0.62)

    def only_wide(view: ViewGeometry) -> Compressed | None:
        return pressed(points, view) if view.thickness_mm > 55.0 else None

    found = estimate_thickness(VIEW, outline, only_wide, facets, HEIGHT)
    assert found is not None
    assert found.thickness_mm == pytest.approx(62.0, rel=0.1)
    assert estimate_thickness(VIEW, outline, lambda _: None, facets, HEIGHT) is None
