"""Ties that draw the silhouette of a compressed breast onto the outline in the mammogram.

The paper estimates the 3-D shape "from the shape of the deformed breast and the circumference of the mammogram"
(section II-C) without a rule. Here the outline acts as a rim: the skin that makes the silhouette is drawn onto the
outline along its normal, through the real cone beam, and the body answers elastically between the plates. So contact
faces stay on the plates, the free edge keeps the bulge of an incompressible body and the volume is kept.
"""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.fem.parts.plane_ties import PlaneTies
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.alignment import measure
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import detector_mm


def outline_ties(
    nodes: Points,
    faces: NDArray[np.integer],
    facets: SkinFacets,
    view: ViewGeometry,
    outline: RadialOutline,
    stiffness_kpa: float,
    memory_mm: NDArray[np.float64] | None = None,
) -> tuple[PlaneTies, NDArray[np.intp]]:
    """Ties at the present silhouette.

    Args:
        nodes: deformed mesh nodes (N, 3) in the plate frame, mm.
        faces: skin faces (F, 4) of the mesh, from which `facets` were cut.
        facets: the faces cut finer.
        view: geometry of the image.
        outline: the mammogram's outline on K rays.
        stiffness_kpa: spring constant per length of outline (mN/mm per mm).
        memory_mm: extra advance (K,) of each plane along its normal, mm, by which former ties fell short.

    Returns:
        The ties, and the rays (T,) on which they are.
    """
    state = measure(facets.positions(nodes), facets.quads, view, outline, facets.rim)
    used = np.flatnonzero((state.weight > 0) & (state.model.edge_nodes[:, 0] >= 0))
    edge, weight = state.model.edge_nodes[used], state.model.edge_weight[used]
    rows = facets.interpolation[edge[:, 0]].multiply((1.0 - weight)[:, None]).tocsr()
    rows = rows + facets.interpolation[edge[:, 1]].multiply(weight[:, None]).tocsr()
    per_face = facets.interpolation.shape[0] // len(faces)
    corners = np.asarray(faces, dtype=np.int64)[edge[:, 0] // per_face]
    shape = np.stack([np.asarray(rows[np.arange(len(used)), corners[:, c]]).ravel() for c in range(4)], axis=-1)
    points = np.einsum("ta,tai->ti", shape, nodes[corners])
    slope = _normal_slope(points, outline.normal[used], view)
    steep = np.linalg.norm(slope, axis=1)
    direction = slope / steep[:, None]
    advance = np.nan_to_num(state.gap_mm[used]) * view.middle_magnification / steep
    if memory_mm is not None:
        advance = advance + memory_mm[used]
    length = _arc_length(outline)[used]
    offset = np.einsum("ti,ti->t", points, direction) + advance
    return PlaneTies(corners, shape, direction, offset, stiffness_kpa * state.weight[used] * length), used


def _normal_slope(points: Points, normal: NDArray[np.float64], view: ViewGeometry) -> NDArray[np.float64]:
    """Gradient (T, 3) of the projected place along the outline's normal (T, 2) (forward, along) by the point."""
    zoom = view.magnification(points[:, 2])
    flat = np.einsum("ti,ti->t", detector_mm(points, view), normal)
    rise = np.zeros_like(zoom) if view.parallel else flat * zoom / view.source_detector_mm
    return np.stack([normal[:, 1] * zoom, -normal[:, 0] * zoom, rise], axis=-1)


def _arc_length(outline: RadialOutline) -> NDArray[np.float64]:
    """Length of outline (K,) that each ray stands for, mm at the detector."""
    step = np.linalg.norm(np.gradient(outline.points(), axis=0), axis=1)
    return np.asarray(np.nan_to_num(step))
