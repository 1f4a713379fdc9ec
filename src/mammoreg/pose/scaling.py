"""Volume-preserving scaling: the affine compression of the paper's reference 1, from which the pose starts."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import breast_to_plate, plate_rotation
from mammoreg.pose.alignment import Alignment, align
from mammoreg.pose.outline import RadialOutline

EDGE_PASSES = 3
SETTLED_MM = 1.0
MIN_FRONT_NODES = 20


@dataclass(frozen=True)
class Scaling:
    """A breast scaled between the plates, and its place in the image.

    Attributes:
        matrix, offset: affine map (3, 3) and (3,) mm from the breast to the plate frame; det(matrix) = 1.
        uncompressed_mm: height of the imaged part before compression.
        alignment: the view after alignment of the outlines.
    """

    matrix: NDArray[np.float64]
    offset: Points
    uncompressed_mm: float
    alignment: Alignment


def fit_scaling(
    skin: Points, quads: NDArray[np.intp], view: ViewGeometry, outline: RadialOutline, *, keep_height: bool = False
) -> Scaling:
    """Scale the breast to the plate gap, widen it alike in both directions across, and bring it onto the outline.

    The outline does not tell how the widening is shared between forward and along the chest wall, because the imaged
    portion is unknown too; so it is shared alike.

    Args:
        skin: undeformed surface nodes (N, 3) in the breast frame, mm.
        quads: facets (Q, 4).
        view: angle, thickness and a first guess of edge and middle.
        outline: the mammogram's outline.
        keep_height: the plates' height is known (second MR volume): the breast is moved to it, not the plates to it.
    """
    turned = breast_to_plate(skin, view.angle_deg)
    heights = _imaged_heights(turned, view.edge_p_mm)
    state = _aligned(turned, quads, view, outline, heights, keep_height)
    for _ in range(EDGE_PASSES):
        former = state.view.edge_p_mm
        heights = _imaged_heights(turned, former)
        state = _aligned(turned, quads, state.view, outline, heights, keep_height)
        if abs(state.view.edge_p_mm - former) < SETTLED_MM:
            break
    scale, offset = _scale(turned, view, heights, keep_height)
    return Scaling(np.diag(scale) @ plate_rotation(view.angle_deg), offset, heights[1] - heights[0], state)


def _imaged_heights(turned: Points, edge_p_mm: float) -> tuple[float, float]:
    front = turned[:, 1] < edge_p_mm
    heights = turned[front, 2] if front.sum() >= MIN_FRONT_NODES else turned[:, 2]
    return float(heights.min()), float(heights.max())


def _scale(
    turned: Points, view: ViewGeometry, heights: tuple[float, float], keep_height: bool
) -> tuple[Points, Points]:
    low, high = heights
    ratio = min(1.0, view.thickness_mm / (high - low))
    scale = np.array([ratio**-0.5, ratio**-0.5, ratio])
    middle = 0.5 * (low + high)
    anchor = np.array([0.5 * (turned[:, 0].min() + turned[:, 0].max()), turned[:, 1].max(), middle])
    target = anchor.copy()
    if keep_height:
        target[2] = view.height_mm + 0.5 * view.thickness_mm
    return scale, target - scale * anchor


def _aligned(
    turned: Points,
    quads: NDArray[np.intp],
    view: ViewGeometry,
    outline: RadialOutline,
    heights: tuple[float, float],
    keep_height: bool,
) -> Alignment:
    scale, offset = _scale(turned, view, heights, keep_height)
    if not keep_height:
        view = replace(view, height_mm=0.5 * (heights[0] + heights[1]) - 0.5 * view.thickness_mm)
    return align(turned * scale + offset, quads, view, outline)
