"""Elongation of the breast across the beam: model against mammogram."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.localization.deformation import MethodView
from mammoreg.meshing.block import BlockMesh
from mammoreg.metrics.elongation import Direction, extents_mm
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import detector_mm
from stages.pose.record import FINE_RAYS, PoseRecord

_METHODS = ("scaling", "plate", "updated")


def elongation_rows(pose: PoseRecord, block: BlockMesh, methods: Mapping[str, MethodView]) -> list[dict[str, Any]]:
    """Extents of each method's silhouette less those of the undeformed breast, and the mammogram's less the same.

    All are measured on the rays on which the mammogram's outline is skin, and divided by the magnification at the
    plates' middle; the undeformed breast is projected in parallel at the view's angle.
    """
    if not pose.has_outline:
        return []
    geometry, outline = pose.geometry, pose.outline(FINE_RAYS)
    standing = replace(geometry, parallel=True)
    before = _extents(outline, breast_to_plate(block.points, geometry.angle_deg), block, standing)
    true = extents_mm(outline.points(), outline.theta, outline.weight)
    rows = []
    for method in (m for m in _METHODS if m in methods):
        after = _extents(outline, methods[method].deformation.forward(block.points), block, geometry)
        for direction in before:
            elongation = _difference(after[direction], before[direction], geometry)
            known = _difference(true[direction], before[direction], geometry)
            row = {"view": pose.view, "method": method, "direction": direction}
            rows.append(row | {"elongation_mm": elongation, "true_mm": known})
    return rows


def _extents(
    outline: RadialOutline, plate_points: Points, block: BlockMesh, geometry: ViewGeometry
) -> dict[Direction, float | None]:
    model = outline.of_model(detector_mm(plate_points, geometry), block.skin_quads())
    return extents_mm(model.points(), outline.theta, outline.weight)


def _difference(after: float | None, before: float | None, geometry: ViewGeometry) -> float | None:
    if after is None or before is None:
        return None
    return (after - before) / geometry.middle_magnification
