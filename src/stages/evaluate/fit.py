"""Pose and fit of each view and method: `views.csv`. It needs no truth."""

from collections.abc import Mapping
from dataclasses import dataclass

from mammoreg.geometry import ViewGeometry
from mammoreg.localization.deformation import MethodView
from mammoreg.meshing.block import BlockMesh
from mammoreg.metrics.outline_fit import outline_fit
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import detector_mm
from stages.engine.artefact import Artefact
from stages.evaluate.mechanical_doubts import MechanicalLimits, mechanical_doubts
from stages.evaluate.predictions import Row
from stages.methods import FINE_RAYS, MESH_METHODS, of_view, pose_outline

COMPRESSION_POINTS = 3.0
"""Beyond this difference of the table's `compression` from what is seen, in percent, the view is marked."""
SULLIVAN_N = (49.0, 186.0)
"""Range of compression forces measured by Sullivan et al. (paper, section II-B)."""


@dataclass(frozen=True)
class Limits:
    """Beyond these a view's result is not trusted.

    Attributes:
        outline_p95_mm: 95th percentile of the outline's misfit.
        beam_gap_mm: gap of the beams to a lesion marked in two views.
        min_det_f: smallest volume ratio in the deformed mesh.
        mechanical: of breasts between plates.
        compression: share of the thickness that the cases table says the plates take away, None where it does not.
    """

    outline_p95_mm: float
    beam_gap_mm: float
    min_det_f: float
    mechanical: MechanicalLimits
    compression: float | None = None


def has_outline(pose: Artefact) -> bool:
    """Whether a view has an outline: not if it has neither image nor second volume."""
    return "outline" in pose.names()


def fit_rows(
    pose: Artefact,
    block: BlockMesh,
    methods: Mapping[str, MethodView],
    results: list[Artefact],
    beam_gaps: Mapping[str, float],
    limits: Limits,
) -> list[Row]:
    """One row per method of a view.

    Args:
        results: artefacts of `compress`, `solve` and `project`.
        beam_gaps: largest gap of the beams to a lesion, by method.
    """
    outline, view = pose_outline(pose, FINE_RAYS) if has_outline(pose) else None, str(pose.view)
    remarks = [*pose.value("flags"), *_other_compression(pose, results, limits.compression)]
    rows = []
    for method, way in methods.items():
        solution = of_view([a for a in results if a.stage == MESH_METHODS.get(method)], view)
        row: Row = {"view": view, "method": method, **_placed(way.geometry, pose.laterality)}
        row |= {"force_n": _plate_force(solution)} | _fit_columns(outline, block, way)
        row["ncc"] = _number(of_view([a for a in results if a.stage == "project"], view), f"{method}_ncc")
        row["outline_step"] = None
        row |= {name: _number(solution, name) for name in ("penetration_mm", "folded_corners")}
        row["estimated"] = "; ".join(pose.value("estimated"))
        compress = of_view([a for a in results if a.stage == "compress"], view)
        doubts = _doubts(row, solution, beam_gaps.get(method), limits)
        doubts += mechanical_doubts(solution, compress, limits.mechanical)
        row["trust"] = "; ".join([*remarks, *doubts])
        rows.append(row)
    return rows


def _placed(geometry: ViewGeometry, laterality: str) -> Row:
    """Pose as the contract's `views.csv` names it: the middle row along (cos a, 0, s sin a) of LPS."""
    return {
        "angle_deg": geometry.angle_deg,
        "edge_p_mm": geometry.edge_p_mm,
        "middle_mm": geometry.middle_mm if laterality == "R" else -geometry.middle_mm,
        "height_mm": geometry.height_mm,
        "thickness_mm": geometry.thickness_mm,
    }


def _fit_columns(outline: RadialOutline | None, block: BlockMesh, way: MethodView) -> Row:
    """Misfit of the method's silhouette at the magnification of the plates' middle; empty without an outline."""
    if outline is None:
        return {"outline_mean_mm": None, "outline_p95_mm": None, "outline_dice": None}
    projected = detector_mm(way.deformation.forward(block.points), way.geometry)
    fit = outline_fit(outline, outline.of_model(projected, block.skin_quads()), block.rim())
    zoom = way.geometry.middle_magnification
    return {
        "outline_mean_mm": None if fit.mean_mm is None else fit.mean_mm / zoom,
        "outline_p95_mm": None if fit.p95_mm is None else fit.p95_mm / zoom,
        "outline_dice": fit.dice,
    }


def _doubts(row: Row, solution: Artefact | None, gap_mm: float | None, limits: Limits) -> list[str]:
    force, misfit, det_f = row["force_n"], row["outline_p95_mm"], _number(solution, "min_det_f")
    doubts = {
        f"outline misfit {misfit or 0:.1f} mm": misfit is not None and misfit > limits.outline_p95_mm,
        f"force {force or 0:.0f} N outside {SULLIVAN_N[0]:.0f}-{SULLIVAN_N[1]:.0f} N": force is not None
        and not SULLIVAN_N[0] <= force <= SULLIVAN_N[1],
        f"low Jacobian {det_f or 0:.2f}": det_f is not None and det_f < limits.min_det_f,
        f"beams miss each other by {gap_mm or 0:.1f} mm": gap_mm is not None and gap_mm > limits.beam_gap_mm,
    }
    return [text for text, holds in doubts.items() if holds]


def _other_compression(pose: Artefact, results: list[Artefact], told: float | None) -> list[str]:
    """The doubt where the table's compression is not what the mammogram or the second volume shows."""
    compress = of_view([a for a in results if a.stage == "compress"], str(pose.view))
    seen = _number(compress, "compression")
    if told is None or seen is None or not has_outline(pose):
        return []
    if abs(told - seen) * 100.0 <= COMPRESSION_POINTS:
        return []
    what = "second volume" if pose.view == "3D" else "mammogram"
    return [f"compression {100 * told:.0f} % in the cases table, {100 * seen:.0f} % in the {what}"]


def _plate_force(solution: Artefact | None) -> float | None:
    """Mean force of both plates, which balance but for the back's share."""
    forces = [_number(solution, f"force_{plate}_n") for plate in ("lower", "upper")]
    known = [force for force in forces if force is not None]
    return sum(known) / len(known) if known else None


def _number(artefact: Artefact | None, name: str) -> float | None:
    return float(artefact.value(name)) if artefact is not None and name in artefact.value_names() else None
