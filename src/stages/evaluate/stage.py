"""Stage `evaluate`: predictions against the truth that the tables name; it alone reads both sides."""

from collections.abc import Mapping
from dataclasses import replace

from pydantic import Field

from stages.annotations import (
    landmarks_in_air,
    mr_landmarks,
    mr_lesion_names,
    mr_lesions,
    view_areas,
    view_landmarks,
    view_lesion_names,
)
from stages.elongation import elongation_rows
from stages.engine.artefact import Fields
from stages.engine.completion import first_failure
from stages.engine.contract import Failure, Inputs, SettingsModel, Stage, Subject, Value
from stages.evaluate.fit import Limits, fit_rows
from stages.evaluate.mark_doubts import mark_doubts
from stages.evaluate.mechanical_doubts import MechanicalLimits
from stages.evaluate.places import (
    landmark_rows_in_compressed,
    landmark_rows_in_mammogram,
    lesion_rows_in_mammogram,
    lesion_rows_in_mr,
)
from stages.evaluate.record import EvaluateFields, Row
from stages.evaluate.size_doubts import ShownSize, size_doubts
from stages.localize.record import Predictions
from stages.mesh.record import MeshRecord
from stages.methods import METHODS, method_views, of_view
from stages.pose.record import PoseRecord
from stages.segment.record import SegmentRecord
from stages.views import IMAGED, view_order

_PER_VIEW = ("pose", "compress", "shape", "solve", "project")


class Settings(SettingsModel):
    """When a view's result is marked as not to be trusted; what is measured has no settings."""

    outline_p95_limit_mm: float = Field(5.0, gt=0, description="95th percentile of the outline's misfit, mm")
    beam_gap_limit_mm: float = Field(10.0, gt=0, description="gap of the beams to a lesion seen in two views, mm")
    mark_gap_limit_mm: float = Field(
        10.0,
        gt=0,
        description="distance of a lesion marked on one side from where its mark on the other side leads, mm "
        "(chosen: sound cases have up to 7)",
    )
    min_det_f_limit: float = Field(0.2, ge=0, le=1, description="smallest volume ratio in the deformed mesh")
    penetration_limit: float = Field(
        0.05,
        gt=0,
        le=1,
        description="skin or back inside a plate, as a share of the thickness; from where the solver "
        "hardens its contact",
    )
    folded_limit: float = Field(
        0.05,
        gt=0,
        le=1,
        description="elements with a folded corner, as a share of all; a few at the breast's rim "
        "are usual (chosen: sound compressions have up to 0.02)",
    )
    drift_limit: float = Field(
        0.06,
        gt=0,
        le=1,
        description="mean sideways motion of the breast over its back, as a share of the thickness: "
        "beyond it tips over (chosen: sound compressions have up to 0.05)",
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Compare every prediction that has a truth; one that failed is a row with an empty distance."""
    artefacts = [a for name in ("segment", "mesh", *_PER_VIEW, "localize") for a in inputs.artefacts(name)]
    found = _against_truth(inputs, Predictions(inputs.artefact("localize")))
    if all(inputs.artefact(name).ok for name in ("segment", "mesh")):
        found.view_rows, found.elongation_rows = _per_view(inputs, settings, subject)
        found.warnings = mark_doubts(found.table_5_rows, found.table_6_rows, settings.mark_gap_limit_mm)
    return replace(found.fields(), failure=first_failure(artefacts))


def without_result(inputs: Inputs, failure: Failure) -> Mapping[str, Value]:
    """Rows with empty distances of all that has a truth."""
    return _against_truth(inputs, Predictions(None)).fields().values


def _against_truth(inputs: Inputs, predictions: Predictions) -> EvaluateFields:
    return EvaluateFields(_table_5(inputs, predictions), _table_6(inputs, predictions), _landmarks(inputs, predictions))


def _pose(inputs: Inputs, view: str) -> PoseRecord | None:
    found = of_view(inputs.artefacts("pose"), "pose", view)
    return None if found is None else PoseRecord(found)


def _table_5(inputs: Inputs, predictions: Predictions) -> list[Row]:
    lesions = mr_lesion_names(inputs)
    rows: list[Row] = []
    for view in IMAGED:
        pose = _pose(inputs, view)
        names = [name for name in view_lesion_names(inputs, view) if name in lesions]
        # A mask that stopped `localize` is not opened again: the trouble is told once.
        compared = pose is not None and any(predictions.in_mammogram(view, m, n) for m in METHODS for n in names)
        areas = view_areas(inputs, pose) if pose is not None and compared else {}
        rows += lesion_rows_in_mammogram(predictions, view, pose, areas, names)
    return rows


def _table_6(inputs: Inputs, predictions: Predictions) -> list[Row]:
    known = mr_lesion_names(inputs)
    marked = {view: view_lesion_names(inputs, view) for view in IMAGED}
    views_of: dict[str, list[str]] = {name: [view for view in IMAGED if name in marked[view]] for name in known}
    views_of = {name: views for name, views in views_of.items() if views}
    compared = any(predictions.in_mr(method, name) for method in METHODS for name in views_of)
    return lesion_rows_in_mr(predictions, mr_lesions(inputs) if compared else {}, views_of)


def _landmarks(inputs: Inputs, predictions: Predictions) -> list[Row]:
    before = mr_landmarks(inputs)
    rows: list[Row] = []
    for view in IMAGED:
        truth = {n: p for n, p in view_landmarks(inputs, view).items() if n in before}
        rows += landmark_rows_in_mammogram(predictions, view, _pose(inputs, view), truth)
    compressed = mr_landmarks(inputs, "mr_compressed_landmarks")
    truth = {n: p for n, p in compressed.items() if n in before}
    return rows + landmark_rows_in_compressed(predictions, before, truth)


def _per_view(inputs: Inputs, settings: Settings, subject: Subject) -> tuple[list[Row], list[Row]]:
    """Fit and elongation of each view whose pose is known."""
    results = [a for name in ("compress", "solve", "project") for a in inputs.artefacts(name)]
    mechanical = MechanicalLimits(settings.penetration_limit, settings.folded_limit, settings.drift_limit)
    limits = Limits(
        settings.outline_p95_limit_mm,
        settings.beam_gap_limit_mm,
        settings.min_det_f_limit,
        mechanical,
        subject.number("compression"),
    )
    gaps = Predictions(inputs.artefact("localize")).beam_gaps()
    mesh = MeshRecord(inputs.artefact("mesh"))
    fits: list[Row] = []
    elongations: list[Row] = []
    poses = [PoseRecord(artefact) for artefact in inputs.artefacts("pose") if artefact.ok]
    of_case = size_doubts([ShownSize(pose.relative_size, pose.imaged_share) for pose in poses])
    for pose in sorted(poses, key=lambda pose: view_order(pose.view)):
        methods = method_views(pose, mesh.reference, results)
        doubts = [*of_case, *_landmark_doubts(inputs, pose)]
        fits += fit_rows(pose, mesh.block, methods, results, gaps, limits, doubts)
        elongations += elongation_rows(pose, mesh.block, methods)
    of_volume = SegmentRecord(inputs.artefact("segment")).doubts
    for row in fits:
        row["trust"] = "; ".join(filter(None, [row["trust"], *of_volume]))
    for row in (row for row in fits if row["trust"]):
        print(f"{row['view']} {row['method']}: {row['trust']}", flush=True)
    return fits, elongations


def _landmark_doubts(inputs: Inputs, pose: PoseRecord) -> list[str]:
    """What speaks against a view's own landmarks, with which its predictions are compared."""
    names = landmarks_in_air(inputs, pose)
    return [f"{len(names)} landmarks marked in the air: check column and row, and the outline"] if names else []


STAGE = Stage(
    name="evaluate",
    schema=1,
    inputs=("segment", "mesh", "localize"),
    optional=(
        *_PER_VIEW,
        "mr_lesion",
        "mr_landmarks",
        "mr_compressed_landmarks",
        *(f"{kind}_{view}" for kind in ("lesion", "landmarks") for view in IMAGED),
    ),
    settings=Settings,
    run=run,
    takes_failed=True,
    without_result=without_result,
)
