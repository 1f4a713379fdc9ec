"""Rigid shift of a view's geometry that brings a model's silhouette onto the outline of the mammogram."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import Silhouette, detector_mm

HUBER_MM = 4.0  # chosen: gaps beyond this (folds, a nipple in profile) pull with constant force
ITERATIONS = 12
SETTLED_MM = 0.01
LONGEST_STEP_MM = 15.0


@dataclass(frozen=True)
class Alignment:
    """A view brought onto the outline.

    Attributes:
        view: the shifted geometry.
        model: silhouette of the model in that view.
        gap_mm: distance (K,) from model to outline along its normal, at the plates' middle; nan where either ends.
        weight: trust (K,) of each gap.
        rms_mm: weighted root mean square of the gaps.
    """

    view: ViewGeometry
    model: Silhouette
    gap_mm: NDArray[np.float64]
    weight: NDArray[np.float64]
    rms_mm: float

    @property
    def robust_mm(self) -> float:
        """As `rms_mm`, by the loss that `align` minimises: beyond Huber's limit a gap's size counts, not its square."""
        total = float(self.weight.sum())
        size = np.abs(np.nan_to_num(self.gap_mm))
        loss = np.where(size < HUBER_MM, size**2, HUBER_MM * (2.0 * size - HUBER_MM))
        return float(np.sqrt(np.sum(self.weight * loss) / total)) if total > 0 else float("nan")


def measure(
    points: Points,
    quads: NDArray[np.intp],
    view: ViewGeometry,
    outline: RadialOutline,
    rim: NDArray[np.bool_] | None = None,
) -> Alignment:
    """Compare a surface (N, 3) of the plate frame with quads (Q, 4) to an outline, without moving it.

    Where the silhouette runs along the surface's `rim` (N,) the model ends and skin does not: nothing is compared.
    """
    model = outline.of_model(detector_mm(points, view), quads)
    gap = outline.normal_gap(model) / view.middle_magnification
    seen = np.isfinite(gap) if rim is None else np.isfinite(gap) & ~model.between(rim)
    weight = np.where(seen, outline.weight, 0.0)
    total = float(weight.sum())
    squares = float(np.sum(weight * np.nan_to_num(gap) ** 2))
    return Alignment(view, model, gap, weight, float(np.sqrt(squares / total)) if total > 0 else float("nan"))


def align(points: Points, quads: NDArray[np.intp], view: ViewGeometry, outline: RadialOutline) -> Alignment:
    """Shift the image over the model, across and along the chest wall, until the outlines agree best.

    Iterated weighted least squares on the gaps along the outline's normals with Huber's weights.

    Args:
        points: surface nodes (N, 3) in the plate frame, mm.
        quads: facets (Q, 4).
        view: geometry to start from; only `edge_p_mm` and `middle_mm` change.
        outline: the mammogram's outline.
    """
    state = measure(points, quads, view, outline)
    for _ in range(ITERATIONS):
        step = _shift(state, outline)
        view = replace(state.view, edge_p_mm=state.view.edge_p_mm + step[0], middle_mm=state.view.middle_mm - step[1])
        state = measure(points, quads, view, outline)
        if np.max(np.abs(step)) < SETTLED_MM:
            break
    return state


def _shift(state: Alignment, outline: RadialOutline) -> NDArray[np.float64]:
    """Least-squares displacement (forward, along), mm, of the model towards the outline."""
    usable = state.weight > 0
    gap = state.gap_mm[usable]
    normal = outline.normal[usable]
    weight = state.weight[usable] * np.minimum(1.0, HUBER_MM / np.maximum(np.abs(gap), 1e-9))
    matrix = normal.T @ (weight[:, None] * normal) + 1e-9 * np.eye(2)
    step = np.linalg.solve(matrix, normal.T @ (weight * gap))
    return np.asarray(np.clip(step, -LONGEST_STEP_MM, LONGEST_STEP_MM))
