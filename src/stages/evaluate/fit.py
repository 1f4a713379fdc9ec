"""Pose and fit of each view and method: `views.csv`. It needs no truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mammoreg.geometry import ViewGeometry
from mammoreg.localization.deformation import MethodView
from mammoreg.materials.cube import SULLIVAN
from mammoreg.meshing.block import BlockMesh
from mammoreg.metrics.outline_fit import outline_fit
from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import detector_mm
from stages.compress.record import CompressRecord
from stages.engine.artefact import Artefact
from stages.evaluate.mechanical_doubts import MechanicalLimits, mechanical_doubts
from stages.evaluate.record import Row
from stages.methods import MESH_METHODS, of_view
from stages.pose.record import FINE_RAYS, PoseRecord
from stages.project.record import ProjectRecord
from stages.solution import SolutionRecord
from stages.views import SECOND_VOLUME

COMPRESSION_POINTS = 3.0
"""Beyond this difference of the table's `compression` from what is seen, in percent, the view is marked."""


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


def fit_rows(
    pose: PoseRecord,
    block: BlockMesh,
    methods: Mapping[str, MethodView],
    results: list[Artefact],
    beam_gaps: Mapping[str, float],
    limits: Limits,
    of_case: Sequence[str] = (),
) -> list[Row]:
    """One row per method of a view.

    Args:
        results: artefacts of `compress`, `solve` and `project`.
        beam_gaps: largest gap of the beams to a lesion, by method.
        of_case: what speaks against the case or the view besides.
    """
    outline, view = pose.outline(FINE_RAYS) if pose.has_outline else None, pose.view
    projected, pressed = (of_view(results, stage, view) for stage in ("project", "compress"))
    compress = None if pressed is None else CompressRecord(pressed)
    remarks = [*pose.flags, *of_case, *_other_compression(pose, compress, limits.compression)]
    rows = []
    for method, way in methods.items():
        solved = of_view(results, MESH_METHODS.get(method), view)
        solution = None if solved is None else SolutionRecord(solved)
        row: Row = {"view": view, "method": method, **_placed(way.geometry, pose.laterality)}
        row |= {"force_n": None if solution is None else solution.force_n} | _fit_columns(outline, block, way)
        row["ncc"] = None if projected is None else ProjectRecord(projected).correlation(method)
        row["outline_step"] = pose.outline_step
        row["penetration_mm"] = None if solution is None else solution.penetration_mm
        row["folded_corners"] = None if solution is None else solution.folded_corners
        row["estimated"] = "; ".join(pose.estimated)
        doubts = _doubts(row, solution, beam_gaps.get(method), limits)
        doubts += mechanical_doubts(solution, compress, limits.mechanical)
        row["trust"] = "; ".join([*remarks, *doubts])
        rows.append(row)
    return rows


def _placed(geometry: ViewGeometry, laterality: str) -> Row:
    """Pose in the patient: the middle row along (cos a, 0, s sin a) of LPS, s = +1 for a left, -1 for a right side."""
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


def _doubts(row: Row, solution: SolutionRecord | None, gap_mm: float | None, limits: Limits) -> list[str]:
    force, misfit, det_f = row["force_n"], row["outline_p95_mm"], None if solution is None else solution.min_det_f
    usual = f"{SULLIVAN.lowest_n:.0f}-{SULLIVAN.highest_n:.0f} N"
    doubts = {
        f"outline misfit {misfit or 0:.1f} mm": misfit is not None and misfit > limits.outline_p95_mm,
        f"force {force or 0:.0f} N outside {usual}": force is not None and not SULLIVAN.holds(force),
        f"low Jacobian {det_f or 0:.2f}": det_f is not None and det_f < limits.min_det_f,
        f"beams miss each other by {gap_mm or 0:.1f} mm": gap_mm is not None and gap_mm > limits.beam_gap_mm,
    }
    return [text for text, holds in doubts.items() if holds]


def _other_compression(pose: PoseRecord, compress: CompressRecord | None, told: float | None) -> list[str]:
    """The doubt where the table's compression is not what the mammogram or the second volume shows."""
    if told is None or compress is None or not pose.has_outline:
        return []
    seen = compress.compression
    if abs(told - seen) * 100.0 <= COMPRESSION_POINTS:
        return []
    what = "second volume" if pose.view == SECOND_VOLUME else "mammogram"
    return [f"compression {100 * told:.0f} % in the cases table, {100 * seen:.0f} % in the {what}"]
