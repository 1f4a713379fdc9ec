"""Pose of one view: projection angle, imaged portion and plate height, from coarse compressions.

Each candidate angle is compressed once with the coarse model; the silhouette is shifted onto the outline, and what
remains, with the dense tissue inside, judges the angle against the prior that the header gives.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.locate import interpolate
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.alignment import Alignment, align, measure
from mammoreg.pose.density import DensityImage, density_correlation, projected_structure
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.size import relative_size

LOGGER = logging.getLogger(__name__)

# The weights of outline and dense tissue are chosen by what they stand for; none is fitted and none has a source.
OUTLINE_SAMPLES = 6.0  # chosen: independent pieces of information along an outline
OUTLINE_FLOOR_MM = 1.0  # chosen: no model meets an outline better than this for its angle alone
PATCH_MM = 14.0  # chosen: width of an independent patch of dense tissue
DETERMINED_SHARE = 0.5  # chosen: the data must carry at least this share of the angle's information
ANGLE_STEP_DEG = 0.25  # angles are rounded to it
AT_BOUND_DEG = 0.5


@dataclass(frozen=True)
class Compressed:
    """A coarse compression: nodes (N, 3) in the plate frame and the lower plate's height, mm."""

    nodes: Points
    height_mm: float


@dataclass(frozen=True)
class DenseTissue:
    """Tissue points tied to the coarse mesh, with the attenuation that they have over fat.

    Attributes:
        hexes: connectivity (E, 8).
        element, local: place of the points in the mesh, (P,) and (P, 3).
        excess: attenuation above fat (P,), any unit.
    """

    hexes: NDArray[np.int64]
    element: NDArray[np.int64]
    local: NDArray[np.float64]
    excess: NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """One projection angle and how well it explains the mammogram.

    Attributes:
        angle_deg: the angle.
        alignment: silhouette on the outline.
        skin: the same silhouette compared where skin makes it, not the rim at which the model ends.
        ncc: correlation of dense tissue.
        misfit: what is minimised.
        surface: skin nodes (N, 3) in the plate frame, mm.
    """

    angle_deg: float
    alignment: Alignment
    skin: Alignment
    ncc: float
    misfit: float
    surface: Points

    @property
    def rim_share(self) -> float:
        """Share of the outline, by trust, that is compared with the rim: there the misfit tells of no angle."""
        whole = float(self.alignment.weight.sum())
        return 1.0 - float(self.skin.weight.sum()) / whole if whole > 0.0 else 0.0


@dataclass(frozen=True)
class PoseEstimate:
    """The pose of a view.

    Attributes:
        view: geometry with angle, edge, middle and height estimated.
        alignment: silhouette of the coarse model against the outline at that pose.
        determined: whether the image, not the header, decided the angle.
        at_bound: whether the angle ended at the bound of the search.
        angle_sd_deg: its standard deviation by the local curvature of the misfit.
        size: how many times as large as the outline the silhouette is; a check, which moves nothing.
        candidates: the angles tried.
    """

    view: ViewGeometry
    alignment: Alignment
    determined: bool
    at_bound: bool
    angle_sd_deg: float
    size: float
    candidates: tuple[Candidate, ...]


def estimate_pose(
    view: ViewGeometry,
    outline: RadialOutline,
    compress: Callable[[ViewGeometry], Compressed | None],
    facets: SkinFacets,
    step_deg: float,
    bound_deg: float,
    prior_sd_deg: float,
    tissue: DenseTissue | None = None,
    mammogram: DensityImage | None = None,
) -> PoseEstimate | None:
    """Estimate the pose around a start (header's angle, edge and middle of the scaled breast).

    Angles are tried a step apart, from the header's outwards until the least misfit is bracketed; then the edge and
    the middle are refined at the best one.

    Args:
        view: start; its angle is the prior's mean.
        outline: the mammogram's outline.
        compress: coarse compression at a view's angle, edge and thickness; None where it does not converge.
        facets: skin of the coarse mesh.
        step_deg: distance of the angles tried; zero keeps the header's.
        bound_deg: largest offset from the header's angle.
        prior_sd_deg: standard deviation of the prior.
        tissue, mammogram: dense tissue of model and image; without them the outline decides alone.

    Returns:
        The estimate, or None where no compression converged.
    """

    def judge(offset_deg: float, start: ViewGeometry) -> Candidate | None:
        at = replace(start, angle_deg=view.angle_deg + offset_deg)
        compressed = compress(at)
        if compressed is None:
            LOGGER.info("angle %.2f degrees: the coarse compression did not converge", at.angle_deg)
            return None
        at = replace(at, height_mm=compressed.height_mm)
        skin = facets.positions(compressed.nodes)
        state = align(skin, facets.quads, at, outline)
        ncc, patches = _density(compressed.nodes, state.view, tissue, mammogram)
        misfit = _misfit(state.robust_mm, ncc, patches, offset_deg / prior_sd_deg)
        tried_at = "angle %.2f degrees: outline %.2f mm, dense tissue %.3f, misfit %.3f"
        LOGGER.info(tried_at, at.angle_deg, state.rms_mm, ncc, misfit)
        on_skin = measure(skin, facets.quads, state.view, outline, facets.rim)
        return Candidate(at.angle_deg, state, on_skin, ncc, misfit, skin)

    first = judge(0.0, view)
    # The plates' edge moves with the first alignment, and the compression with the edge.
    start = view if first is None else first.alignment.view
    tried = _bracketed(lambda offset: judge(offset, start), step_deg, bound_deg)
    if not tried:
        return None
    ordered = [tried[offset] for offset in sorted(tried)]
    best, sd = _best_angle(ordered)
    nearest = min(ordered, key=lambda c: abs(c.angle_deg - best))
    final = judge(best - view.angle_deg, nearest.alignment.view) or nearest
    determined = 1.0 - (sd / prior_sd_deg) ** 2 >= DETERMINED_SHARE
    at_bound = abs(best - view.angle_deg) > bound_deg - AT_BOUND_DEG and step_deg > 0.0
    size = relative_size(final.surface, facets.quads, final.alignment.view, outline)
    return PoseEstimate(final.alignment.view, final.alignment, determined, at_bound, sd, size, tuple(ordered))


def _bracketed(judge: Callable[[float], Candidate | None], step_deg: float, bound_deg: float) -> dict[float, Candidate]:
    """Candidates by offset: around the header's angle, then outwards while the best one lies at an end."""
    tried: dict[float, Candidate] = {}
    attempted: set[float] = set()
    offsets = [0.0] if step_deg == 0.0 else [0.0, -step_deg, step_deg]
    while offsets:
        attempted.update(offsets)
        tried |= {offset: found for offset in offsets if (found := judge(offset)) is not None}
        if not tried or step_deg == 0.0:
            break
        best = min(tried, key=lambda o: tried[o].misfit)
        ends = (best - step_deg, best + step_deg)
        offsets = [end for end in ends if abs(end) <= bound_deg and end not in attempted]
    return tried


def _misfit(outline_mm: float, ncc: float, patches: float, offset: float) -> float:
    """Minus twice the log likelihood of outline and dense tissue, plus the prior.

    The outline's error is the model's own and of unknown size, so its variance is profiled out.
    """
    by_outline = OUTLINE_SAMPLES * np.log(outline_mm**2 + OUTLINE_FLOOR_MM**2)
    by_density = patches * np.log(1.0 - max(ncc, 0.0) ** 2)
    return float(by_outline + by_density + offset**2)


def _density(
    nodes: Points, view: ViewGeometry, tissue: DenseTissue | None, mammogram: DensityImage | None
) -> tuple[float, float]:
    """Correlation of dense tissue and the number of independent patches that carry it."""
    if tissue is None or mammogram is None:
        return 0.0, 0.0
    points = interpolate(tissue.hexes, tissue.element, tissue.local, nodes)
    model = projected_structure(points, tissue.excess, view, mammogram.structure.shape)
    ncc = density_correlation(model, mammogram)
    if not np.isfinite(ncc):
        return 0.0, 0.0
    return ncc, float(mammogram.mask.sum()) * (mammogram.pixel_mm / PATCH_MM) ** 2


def _best_angle(tried: Sequence[Candidate]) -> tuple[float, float]:
    """Angle of least misfit between the candidates, and its standard deviation from the curvature (degrees)."""
    angles = np.array([c.angle_deg for c in tried])
    misfits = np.array([c.misfit for c in tried])
    if len(tried) < 3:
        return float(angles[np.argmin(misfits)]), float("inf")
    middle = int(np.clip(np.argmin(misfits), 1, len(tried) - 2))
    around = slice(middle - 1, middle + 2)
    bend, slope, _ = np.polyfit(angles[around] - angles[middle], misfits[around], 2)
    if bend <= 0.0:
        return float(angles[np.argmin(misfits)]), float("inf")
    low, high = angles[around][0], angles[around][-1]
    best = float(np.clip(angles[middle] - 0.5 * slope / bend, low, high))
    return round(best / ANGLE_STEP_DEG) * ANGLE_STEP_DEG, float(1.0 / np.sqrt(bend))
