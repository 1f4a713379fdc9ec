"""Study `volunteer`: a volunteer's landmarks under the paper's materials, boundary conditions and skins.

Everything but what a table varies stays as in the main run: pose, mesh, plates, and how the second volume's outline
places a result. Tables II and IV start from the paper's tissue, isotropic and homogeneous.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from mammoreg.arrays import Points
from mammoreg.errors import DataError, NotConvergedError
from mammoreg.materials.tissue import MATERIALS
from stages.compress.record import CompressRecord
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Inputs, SettingsModel, Stage, Subject
from stages.mechanics import Mechanics
from stages.solution import SolutionRecord
from stages.studies.chain import Plan, plan_of, run_chain
from stages.studies.volunteer.additional_points import draw_to_points, surface_points
from stages.studies.volunteer.case import Landmarks, VolunteerCase, volunteer_case, volunteer_landmarks

SKINS = ("none", "attached", "sliding", "adherent")
TABLES = {"table_2": ("model", MATERIALS), "table_3": ("boundary", ("plate", "additional_points", "updated"))}
TABLES |= {"table_4": ("skin", SKINS)}
REFERENCES = {"table_2": "homogeneous", "table_3": "plate", "table_4": "none"}
_GIVEN = ("segment", "mesh", "calibrate", "pose")
_POINTS = ("mr_landmarks", "mr_compressed_landmarks", "mr_surface_points", "mr_compressed_surface_points")


class Settings(SettingsModel):
    """What the paper's Tables II to IV start from; the rest is that of the main run."""

    fibre_ratio: float = Field(
        0.0,
        ge=0.0,
        le=20.0,
        description="`fibre_ratio` of Tables II and IV; 0 is the paper's isotropic tissue. Table III has the run's own",
    )
    skin_friction: float = Field(
        0.0,
        ge=0.0,
        le=2.0,
        description="plates' friction in Table IV; none passes through a sliding skin, so that only without any do the "
        "rows differ by the skin alone",
    )
    point_stiffness: float = Field(
        100.0,
        gt=0.0,
        le=1e4,
        description="stiffness of the springs of Table III's additional points in units of the shear modulus times "
        "the side of a skin face",
    )


@dataclass(frozen=True)
class Outcome:
    """What a variation came to.

    Attributes:
        places: of the landmarks in the second volume (L, 3), breast frame, mm; None if there are none.
        message: why not.
        report: of the solve, and the breast's elongations.
    """

    places: Points | None = None
    message: str = ""
    report: Mapping[str, Any] = field(default_factory=dict)


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Deform the breast in every way of the three tables and measure the landmarks."""
    landmarks = volunteer_landmarks(inputs, subject.laterality)
    if landmarks is None:
        return Fields(values={f"{table}_rows": [] for table in TABLES})
    case, values = volunteer_case(inputs, landmarks), dict[str, Any]()
    if isinstance(case, str):
        outcomes = {table: dict.fromkeys(names, Outcome(message=case)) for table, (_, names) in TABLES.items()}
    else:
        plan = _plan(inputs, subject, case)
        own, plain = _own(plan), _paper_tissue(plan, settings)
        smooth = plain.model_copy(update={"friction": settings.skin_friction})
        outcomes = {
            "table_2": {m: _compressed(plan, case, plain.model_copy(update={"material": m})) for m in MATERIALS},
            "table_3": _boundaries(inputs, case, settings),
            "table_4": {skin: _compressed(plan, case, smooth.model_copy(update={"skin": skin})) for skin in SKINS},
        }
        values["mechanics"] = {"own": own.plain(), "plain": plain.plain(), "smooth": smooth.plain()}
    for table, (key, _) in TABLES.items():
        values[f"{table}_rows"] = _rows(key, landmarks, outcomes[table])
    values["runs"] = [row for table, found in outcomes.items() for row in _runs(table, found)]
    return Fields(values=values)


def _runs(table: str, outcomes: Mapping[str, Outcome]) -> list[dict[str, Any]]:
    """Report of each variation, and how far it has moved the landmarks from where the reference puts them."""
    reference, rows = outcomes[REFERENCES[table]].places, []
    for name, outcome in outcomes.items():
        moved = None
        if outcome.places is not None and reference is not None:
            moved = float(np.linalg.norm(outcome.places - reference, axis=1).mean())
        rows.append({"table": table, "name": name, "message": outcome.message, "moved_mm": moved, **outcome.report})
    return rows


def _rows(key: str, landmarks: Landmarks, outcomes: Mapping[str, Outcome]) -> list[dict[str, Any]]:
    """Rows of a table: the landmarks before, best translated, and by each variation."""
    places = {"before": landmarks.before, "translation": landmarks.translated()}
    found = places | {name: outcome.places for name, outcome in outcomes.items()}
    return [row for name, there in found.items() for row in landmarks.rows(key, name, there)]


def _plan(inputs: Inputs, subject: Subject, case: VolunteerCase) -> Plan:
    """What variations run with, in the view that the second volume shows alone."""
    plan, view = plan_of(inputs, subject, _GIVEN, ("compress",)), case.pose.view
    return replace(plan, rows={view: plan.rows[view]})


def _own(plan: Plan) -> Mechanics:
    """Mechanics of the main run's compression."""
    return Mechanics.model_validate(plan.settings.get("compress", {}).get("mechanics", {}))


def _paper_tissue(plan: Plan, settings: Settings) -> Mechanics:
    plain = {"material": "homogeneous", "skin": "none", "fibre_ratio": settings.fibre_ratio}
    return _own(plan).model_copy(update=plain)


def _compressed(plan: Plan, case: VolunteerCase, mechanics: Mechanics) -> Outcome:
    """The breast between the plates with other mechanics."""
    changes = {"compress": {"mechanics": mechanics.plain()}}
    with tempfile.TemporaryDirectory() as folder:
        (path,) = run_chain(plan, ("compress",), Path(folder), changes).artefacts["compress"]
        return _outcome(case, Artefact(path))


def _outcome(case: VolunteerCase, solution: Artefact | None) -> Outcome:
    if solution is None:
        return Outcome(message="the main run has no result")
    if not solution.ok:
        return Outcome(message=solution.message)
    found = SolutionRecord(solution)
    return _measured(case, found.deformed, found.report())


def _measured(case: VolunteerCase, deformed: Points, report: Mapping[str, Any]) -> Outcome:
    return Outcome(case.placed(deformed), report={**report, **case.elongations(deformed)})


def _boundaries(inputs: Inputs, case: VolunteerCase, settings: Settings) -> dict[str, Outcome]:
    """Table III: `plate` and `updated` are the main run's own; the additional points go on from its compression."""
    compress, solve = (_of_view(inputs.artefacts(name), case.pose.view) for name in ("compress", "solve"))
    return {
        "plate": _outcome(case, compress),
        "additional_points": _drawn(inputs, case, compress, settings),
        "updated": _outcome(case, solve),
    }


def _of_view(artefacts: Sequence[Artefact], view: str | None) -> Artefact | None:
    """The artefact of a view, a failed one too."""
    return next((artefact for artefact in artefacts if artefact.view == view), None)


def _drawn(inputs: Inputs, case: VolunteerCase, compress: Artefact | None, settings: Settings) -> Outcome:
    points = surface_points(inputs, case)
    if points is None:
        return Outcome(message="the table of the cases names no mr_surface_points")
    if compress is None or not compress.ok:
        return _outcome(case, compress)
    try:
        drawn = draw_to_points(case, CompressRecord(compress), points, settings.point_stiffness)
    except (DataError, NotConvergedError) as error:
        return Outcome(message=str(error))
    return _measured(case, drawn.deformed, drawn.report())


STAGE = Stage(
    name="volunteer",
    schema=1,
    inputs=("segment", "mesh", "pose"),
    optional=("calibrate", "compress", "solve", *_POINTS),
    settings=Settings,
    run=run,
    takes_failed=True,
)
