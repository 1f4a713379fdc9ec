"""Surface of the compressed breast that meets the mammogram's outline."""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.fem.parts.plane_ties import PlaneTies
from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.alignment import Alignment, measure
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import detector_mm
from mammoreg.shape.outline_ties import outline_ties

LOGGER = logging.getLogger(__name__)

REST_DAMPING = 0.05
HIDDEN_MM = 0.3  # at the detector


@dataclass(frozen=True)
class ShapeEstimate:
    """The breast with its silhouette on the outline.

    Attributes:
        closed: the breast between the plates, drawn to the outline.
        before, after: silhouettes against the outline.
        rounds: how often the ties were renewed.
    """

    closed: Closed
    before: Alignment
    after: Alignment
    rounds: int


def estimate_shape(
    closing: Closing,
    closed: Closed,
    faces: NDArray[np.integer],
    facets: SkinFacets,
    view: ViewGeometry,
    outline: RadialOutline,
    stiffness: float,
    rounds: int,
    settled_mm: float,
) -> ShapeEstimate:
    """Draw the silhouette onto the outline and let the body follow between the plates.

    The ties are renewed on the silhouette that they have made, and advanced by what they fell short of, until the
    mean misfit is settled. Where skin that was drawn inwards has left the silhouette to other skin, it stays drawn:
    else the two would take turns.

    Args:
        closing: the breast and its plates; `closed` is its result for the gap.
        faces: skin faces (F, 4) from which `facets` were cut.
        view: geometry of the image in the frame of `closed`.
        outline: the mammogram's outline.
        stiffness: of the ties, in units of the mean shear modulus per mm of outline.
        rounds: at most.
        settled_mm: the ties are renewed while the mean misfit is above this.

    Raises:
        NotConvergedError: with the reason.
    """
    before = after = measure(facets.positions(closed.deformed), facets.quads, view, outline, facets.rim)
    mu_kpa = closing.model.mean_mu_kpa
    memory, held, done = np.zeros(len(outline.theta)), None, 0
    best = (before, closed)
    while done < rounds and _mean_misfit(after) > settled_mm:
        ties, rays = outline_ties(closed.deformed, faces, facets, view, outline, stiffness * mu_kpa, memory)
        closed = closing.rest(closed, ties if held is None else ties.joined(held), REST_DAMPING)
        after = measure(facets.positions(closed.deformed), facets.quads, view, outline, facets.rim)
        hidden = _hidden(ties, rays, closed.deformed, view, outline, after)
        inwards = ties.kept(hidden & (ties.distance(closed.deformed) > 0.0))
        held = inwards if held is None else held.joined(inwards)
        memory = memory + np.where(after.weight > 0, np.nan_to_num(after.gap_mm), 0.0) * view.middle_magnification
        memory[rays[hidden]] = 0.0
        done += 1
        LOGGER.info("round %d: silhouette %.2f mm off the outline on average", done, _mean_misfit(after))
        if _mean_misfit(after) < _mean_misfit(best[0]):
            best = (after, closed)
    after, closed = best
    return ShapeEstimate(closed, before, after, done)


def _hidden(
    ties: PlaneTies,
    rays: NDArray[np.intp],
    nodes: Points,
    view: ViewGeometry,
    outline: RadialOutline,
    state: Alignment,
) -> NDArray[np.bool_]:
    """Which tied points (T,) lie within the silhouette now, because other skin makes it."""
    inside = state.model.points()[rays] - detector_mm(ties.points(nodes), view)
    depth = np.einsum("ti,ti->t", inside, outline.normal[rays])
    return np.asarray(np.nan_to_num(depth) > HIDDEN_MM)


def _mean_misfit(state: Alignment) -> float:
    full = state.weight > 0.99
    return float(np.abs(state.gap_mm[full]).mean()) if full.any() else 0.0
