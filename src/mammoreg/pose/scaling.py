"""Volume-preserving scaling: the affine compression of the paper's reference 1, from which the pose starts."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import Points, breast_to_plate, plate_rotation
from mammoreg.pose.alignment import Alignment, align
from mammoreg.pose.outline import RadialOutline

EDGE_PASSES = 3
MIN_FRONT_NODES = 20


@dataclass(frozen=True)
class Scaling:
    """A breast scaled between the plates, and its place in the image.

    Attributes:
        matrix, offset: affine map (3, 3) and (3,) mm from the breast to the plate frame; det(matrix) = 1.
        share_along: share in [0, 1] of the widening that goes along the chest wall, the rest goes forward.
        uncompressed_mm: height of the imaged part before compression.
        alignment: the view after alignment of the outlines.
    """

    matrix: NDArray[np.float64]
    offset: Points
    share_along: float
    uncompressed_mm: float
    alignment: Alignment


def fit_scaling(
    skin: Points, quads: NDArray[np.intp], view: ViewGeometry, outline: RadialOutline, *, keep_height: bool = False
) -> Scaling:
    """Scale the breast to the plate gap and distribute the widening as the outline asks.

    Args:
        skin: undeformed surface nodes (N, 3) in the breast frame, mm.
        quads: facets (Q, 4).
        view: angle, thickness and a first guess of edge and middle.
        outline: the mammogram's outline.
        keep_height: the plates' height is known (second MR volume): the breast is moved to it, not the plates to it.
    """
    turned = breast_to_plate(skin, view.angle_deg)
    share, aligned, low, high = 0.5, view, 0.0, 0.0
    state: Alignment | None = None
    for _ in range(EDGE_PASSES):
        low, high = _imaged_heights(turned, aligned.edge_p_mm)
        at = aligned
        found = minimize_scalar(
            lambda s, at=at, low=low, high=high: _aligned(turned, quads, at, outline, s, low, high, keep_height).rms_mm,
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 0.02},
        )
        share = float(found.x)
        state = _aligned(turned, quads, aligned, outline, share, low, high, keep_height)
        moved = abs(state.view.edge_p_mm - aligned.edge_p_mm)
        aligned = state.view
        if moved < 1.0:
            break
    assert state is not None
    scale, offset = _scale(turned, view, share, low, high, keep_height)
    return Scaling(np.diag(scale) @ plate_rotation(view.angle_deg), offset, share, high - low, state)


def fit_thickness(
    skin: Points, quads: NDArray[np.intp], view: ViewGeometry, outline: RadialOutline, shares: tuple[float, float]
) -> float:
    """Plate gap, mm, at which the breast, widened alike in both directions, meets the outline best.

    The paper takes it from the diameters in MR and mammogram (section II-C); so does this, from all diameters at once.

    Args:
        skin, quads, view, outline: as in `fit_scaling`; the view's thickness is not read.
        shares: smallest and largest gap that is considered, as shares of the uncompressed height.
    """
    turned = breast_to_plate(skin, view.angle_deg)
    low, high = _imaged_heights(turned, view.edge_p_mm)

    def misfit(share: float) -> float:
        at = replace(view, thickness_mm=share * (high - low))
        return _aligned(turned, quads, at, outline, 0.5, low, high, False).rms_mm

    found = minimize_scalar(misfit, bounds=shares, method="bounded", options={"xatol": 0.01})
    return float(found.x) * (high - low)


def _imaged_heights(turned: Points, edge_p_mm: float) -> tuple[float, float]:
    front = turned[:, 1] < edge_p_mm
    heights = turned[front, 2] if front.sum() >= MIN_FRONT_NODES else turned[:, 2]
    return float(heights.min()), float(heights.max())


def _scale(
    turned: Points, view: ViewGeometry, share: float, low: float, high: float, keep_height: bool
) -> tuple[Points, Points]:
    ratio = min(1.0, view.thickness_mm / (high - low))
    scale = np.array([ratio**-share, ratio ** (share - 1.0), ratio])
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
    share: float,
    low: float,
    high: float,
    keep_height: bool,
) -> Alignment:
    scale, offset = _scale(turned, view, share, low, high, keep_height)
    if not keep_height:
        view = replace(view, height_mm=0.5 * (low + high) - 0.5 * view.thickness_mm)
    return align(turned * scale + offset, quads, view, outline)
