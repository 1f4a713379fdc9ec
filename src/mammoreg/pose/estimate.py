"""Pose of one view: projection angle, imaged portion and plate height, from coarse compressions.

Each candidate angle is compressed once with the coarse model; the silhouette is shifted onto the outline, and what
remains, with the dense tissue inside, judges the angle against the prior that the header gives.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import Points
from mammoreg.meshing.locate import interpolate
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.alignment import Alignment, align
from mammoreg.pose.density import DensityImage, correlation, projected_structure
from mammoreg.pose.outline import RadialOutline

OUTLINE_SD_MM = 2.0  # what a homogeneous model leaves of an outline at the right angle
OUTLINE_SAMPLES = 6.0  # independent pieces of information along an outline
PATCH_MM = 14.0  # width of an independent patch of dense tissue
DETERMINED_SHARE = 0.5  # the data must carry at least this share of the angle's information
ANGLE_STEP_DEG = 0.25


@dataclass(frozen=True)
class Compressed:
    """A coarse compression: nodes (N, 3) in the plate frame and the lower plate's height, mm."""

    nodes: Points
    height_mm: float


@dataclass(frozen=True)
class Tissue:
    """Tissue points tied to the coarse mesh, with the attenuation that they have over fat.

    Attributes:
        hexes: connectivity (E, 8).
        element, local: place of the points in the mesh, (P,) and (P, 3).
        excess: attenuation above fat (P,), any unit.
    """

    hexes: NDArray[np.integer]
    element: NDArray[np.integer]
    local: NDArray[np.float64]
    excess: NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """One projection angle and how well it explains the mammogram."""

    angle_deg: float
    alignment: Alignment
    ncc: float
    misfit: float


@dataclass(frozen=True)
class PoseEstimate:
    """The pose of a view.

    Attributes:
        view: geometry with angle, edge, middle and height estimated.
        alignment: silhouette of the coarse model against the outline at that pose.
        determined: whether the image, not the header, decided the angle.
        angle_sd_deg: its standard deviation by the local curvature of the misfit.
        candidates: the angles tried.
    """

    view: ViewGeometry
    alignment: Alignment
    determined: bool
    angle_sd_deg: float
    candidates: tuple[Candidate, ...]


def estimate_pose(
    view: ViewGeometry,
    outline: RadialOutline,
    compress: Callable[[ViewGeometry], Compressed | None],
    facets: SkinFacets,
    offsets_deg: Sequence[float],
    prior_sd_deg: float,
    tissue: Tissue | None = None,
    mammogram: DensityImage | None = None,
) -> PoseEstimate | None:
    """Estimate the pose around a start (header's angle, edge and middle of the scaled breast).

    Args:
        view: start; its angle is the prior's mean.
        outline: the mammogram's outline.
        compress: coarse compression at a view's angle, edge and thickness; None where it does not converge.
        facets: skin of the coarse mesh.
        offsets_deg: angles to try, relative to the header's, increasing; a single one keeps the angle.
        prior_sd_deg: standard deviation of the prior.
        tissue, mammogram: dense tissue of model and image; without them the outline decides alone.

    Returns:
        The estimate, or None where no compression converged.
    """

    def judge(angle_deg: float, start: ViewGeometry) -> Candidate | None:
        at = replace(start, angle_deg=angle_deg)
        compressed = compress(at)
        if compressed is None:
            return None
        at = replace(at, height_mm=compressed.height_mm)
        state = align(facets.positions(compressed.nodes), facets.quads, at, outline)
        ncc, patches = _density(compressed.nodes, state.view, tissue, mammogram)
        offset = (angle_deg - view.angle_deg) / prior_sd_deg
        misfit = OUTLINE_SAMPLES * (state.rms_mm / OUTLINE_SD_MM) ** 2 + offset**2
        return Candidate(angle_deg, state, ncc, misfit + patches * np.log(max(1.0 - max(ncc, 0.0) ** 2, 1e-3)))

    start = view
    tried: list[Candidate] = []
    for offset in sorted(offsets_deg, key=abs):
        candidate = judge(view.angle_deg + offset, start)
        if candidate is not None:
            tried.append(candidate)
            start = tried[0].alignment.view
    if not tried:
        return None
    tried.sort(key=lambda c: c.angle_deg)
    best, sd = _best_angle(tried)
    nearest = min(tried, key=lambda c: abs(c.angle_deg - best))
    final = judge(best, nearest.alignment.view) or nearest
    determined = len(tried) > 2 and 1.0 - (sd / prior_sd_deg) ** 2 >= DETERMINED_SHARE
    return PoseEstimate(final.alignment.view, final.alignment, determined, sd, tuple(tried))


def _density(
    nodes: Points, view: ViewGeometry, tissue: Tissue | None, mammogram: DensityImage | None
) -> tuple[float, float]:
    """Correlation of dense tissue and the number of independent patches that carry it."""
    if tissue is None or mammogram is None:
        return 0.0, 0.0
    points = interpolate(tissue.hexes, tissue.element, tissue.local, nodes)
    model = projected_structure(points, tissue.excess, view, mammogram.structure.shape)
    ncc = correlation(model, mammogram)
    if not np.isfinite(ncc):
        return 0.0, 0.0
    return ncc, float(mammogram.mask.sum()) * (mammogram.pixel_mm / PATCH_MM) ** 2


def _best_angle(tried: Sequence[Candidate]) -> tuple[float, float]:
    """Angle of least misfit between the candidates, and its standard deviation from the curvature (degrees)."""
    angles = np.array([c.angle_deg for c in tried])
    misfits = np.array([c.misfit for c in tried])
    if len(tried) < 3:
        return float(angles[np.argmin(misfits)]), float("inf")
    fine = np.arange(angles[0], angles[-1] + 1e-9, ANGLE_STEP_DEG)
    best = float(fine[np.argmin(PchipInterpolator(angles, misfits)(fine))])
    bend = float(np.polyfit(angles - best, misfits, 2)[0])
    return best, float(1.0 / np.sqrt(bend)) if bend > 0 else float("inf")
