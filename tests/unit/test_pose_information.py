"""How far an outline that no model meets draws angle and thickness away from what header and experience say.

The outline counts as six independent gaps of one Gaussian error of unknown size. Here the posterior of that statement
is scanned finely, with the misfit of `align` alone, and compared with what the searches find by few compressions.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.stats import norm

from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.alignment import align
from mammoreg.pose.estimate import Compressed, estimate_pose
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import detector_mm, quad_edges, ray_angles, silhouette
from mammoreg.pose.thickness import estimate_thickness
from tests.unit.block_meshes import half_ellipsoid

VIEW = ViewGeometry(35.0, -15.0, 0.0, 0.0, 60.0, 650.0, 15.0, 1.0, 200, 130)
MESH = half_ellipsoid(4, (75.0, 85.0, 35.0))  # half axes, mm: its shadow tells the angle
HEIGHT_MM = 100.0
INDEPENDENT_GAPS = 6
FACETS = skin_facets(MESH.skin_quads(), len(MESH.points), 2)
PAPER_SHARES = 1.0 - np.array([0.21, 0.50])  # what the paper's compressions leave of the thickness


def pressed(view: ViewGeometry) -> Compressed:
    """Pressed flat, widened alike, volume kept."""
    share = view.thickness_mm / HEIGHT_MM
    turned = breast_to_plate(MESH.points, view.angle_deg)
    return Compressed(turned * [share**-0.5, share**-0.5, share], -0.5 * view.thickness_mm)


def wavy_outline(truth: ViewGeometry, wave_mm: float) -> RadialOutline:
    """Outline of the breast at a pose, with waves that no pose explains."""
    flat = detector_mm(FACETS.positions(pressed(truth).nodes), replace(truth, height_mm=-0.5 * truth.thickness_mm))
    points = silhouette(flat, quad_edges(FACETS.quads), 0.0, ray_angles(181)).points()
    points = points[np.isfinite(points).all(axis=1)]
    outline = radial_outline(points, np.clip(points[:, 0] / 10.0, 0.0, 1.0), ray_angles(61))
    waves = wave_mm * truth.middle_magnification * np.cos(8.0 * outline.theta)
    return replace(outline, radius=outline.radius + waves)


def rms_mm(view: ViewGeometry, outline: RadialOutline) -> float:
    """What remains of the misfit at an angle and thickness, the breast's place aside."""
    for _ in range(2):
        squeezed = pressed(view)
        placed = replace(view, height_mm=squeezed.height_mm)
        found = align(FACETS.positions(squeezed.nodes), FACETS.quads, placed, outline)
        view = found.view
    return found.rms_mm


def likeliest(values: NDArray[np.float64], misfits_mm: list[float], prior: Any) -> float:
    """Value of the largest posterior; the Gaussian's size is the one that explains each misfit best, 1 mm at least."""
    fine = np.linspace(values[0], values[-1], 1001)
    size = np.hypot(CubicSpline(values, misfits_mm)(fine), 1.0)
    best = int(np.argmax(INDEPENDENT_GAPS * norm.logpdf(size, scale=size) + prior.logpdf(fine)))
    assert 0 < best < len(fine) - 1, "the scan must hold the answer"
    return float(fine[best])


def test_header_draws_the_angle_as_far_as_six_gaps_allow() -> None:
    true_deg = 28.0
    outline, prior_sd = wavy_outline(replace(VIEW, angle_deg=true_deg), 3.0), 5.0
    angles = VIEW.angle_deg + np.linspace(-12.0, 12.0, 9)
    misfits = [rms_mm(replace(VIEW, angle_deg=angle), outline) for angle in angles]
    expected = likeliest(angles, misfits, norm(VIEW.angle_deg, prior_sd))
    found = estimate_pose(VIEW, outline, pressed, FACETS, 4.0, 16.0, prior_sd)
    assert found is not None
    assert abs(expected - true_deg) > 1.0, "the header must count for this test to say anything"
    assert found.view.angle_deg == pytest.approx(expected, abs=0.5)


def test_paper_s_compressions_draw_the_thickness_as_far_as_six_gaps_allow() -> None:
    share = 0.8
    outline = wavy_outline(replace(VIEW, thickness_mm=share * HEIGHT_MM), 10.0)
    shares = np.linspace(0.4, 0.8, 9)
    misfits = [rms_mm(replace(VIEW, thickness_mm=s * HEIGHT_MM), outline) for s in shares]
    expected = likeliest(shares, misfits, norm(PAPER_SHARES.mean(), 0.1))
    found = estimate_thickness(VIEW, outline, pressed, FACETS, HEIGHT_MM)
    assert found is not None
    assert abs(expected - share) > 0.02, "the paper's range must count for this test to say anything"
    assert found.thickness_mm == pytest.approx(expected * HEIGHT_MM, abs=1.0)


def test_outline_that_says_nothing_leaves_the_middle_of_the_paper_s_compressions() -> None:
    outline = wavy_outline(VIEW, 0.0)
    alike = pressed(VIEW)
    found = estimate_thickness(VIEW, outline, lambda _: alike, FACETS, HEIGHT_MM)
    assert found is not None
    assert found.thickness_mm == pytest.approx(PAPER_SHARES.mean() * HEIGHT_MM, abs=1.0)
