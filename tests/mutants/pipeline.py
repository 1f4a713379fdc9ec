"""One case through the product's own roads, in this process: `check`, its stages one by one, predictions and trust.

A stage whose inputs hold what they held for the unmutated case is not run again: the same inputs give the same bytes.
"""

import hashlib
import json
import time
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stages.cohort.cases import Cohort, read_cohort
from stages.cohort.preflight import check_cohort, choices_of, warnings_of
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Subject
from stages.engine.errors import FaultsError, UserError
from stages.engine.registry import STAGE_MODULES, VIEW_STAGES, load_stage
from stages.engine.run import content_id, run_stage
from stages.localize.record import Predictions
from stages.pose.record import PoseRecord

CHAIN = ("segment", "mesh", "calibrate", "pose", "compress", "shape", "solve", "localize", "evaluate")
Settings = Mapping[str, Mapping[str, Any]]
SETTINGS: Settings = {"mesh": {"elements": 4}, "segment": {"spacing_mm": 2.0}}
"""Coarser than the defaults, so that hundreds of cases are affordable."""
METHOD = "updated"


@dataclass
class Outcome:
    """How a case ended.

    Attributes:
        ended: check, failed, ok, bug or traceback.
        message: faults, the first failure, or the traceback's end.
        flags: by view, `trust` of `updated` in views.csv, and what the predictions say against themselves.
        marks_differ: what the marks of both sides say against each other.
        marks: by view or "MR", the places of lesions and landmarks; pixels as stored, or LPS mm.
        scale_mm: by view, mm in the breast per pixel of the stored picture.
        estimated: what neither header nor table gave, by view.
    """

    ended: str
    message: str = ""
    flags: dict[str, str] = field(default_factory=dict)
    marks_differ: list[str] = field(default_factory=list)
    marks: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    scale_mm: dict[str, float] = field(default_factory=dict)
    estimated: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0

    def write(self, path: Path) -> None:
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> "Outcome":
        return cls(**json.loads(path.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class Done:
    """An artefact and a digest of what it holds, its provenance left out."""

    path: Path
    content: str


Memory = dict[str, Done]
"""Artefacts at hand, by what their stage was given."""


def write_memory(path: Path, memory: Memory) -> None:
    path.write_text(json.dumps({key: [str(done.path), done.content] for key, done in memory.items()}))


def read_memory(path: Path) -> Memory:
    return {key: Done(Path(where), content) for key, (where, content) in json.loads(path.read_text()).items()}


def run_case(tables: tuple[Path, Path], results: Path, memory: Memory) -> Outcome:
    """Check a cohort of one case and run it as far as stage `evaluate`; nothing is raised.

    Args:
        tables: cases.tsv and views.tsv.
        results: folder for the artefacts.
        memory: artefacts that need not be made again; new ones are added.
    """
    start = time.process_time()
    try:
        outcome = _run(tables, results, memory)
    except Exception:
        outcome = Outcome("traceback", traceback.format_exc()[-2000:])
    outcome.seconds = round(time.process_time() - start, 2)
    return outcome


def _run(tables: tuple[Path, Path], results: Path, memory: Memory) -> Outcome:
    try:
        cohort = read_cohort(*tables)
        if faults := check_cohort(cohort):
            raise FaultsError(faults)
        warnings_of(cohort), choices_of(cohort)
    except UserError as error:
        return Outcome("check", str(error))
    if not cohort.cases:
        return Outcome("ok", "no case is left to run")
    return _outcome(_Chain(cohort, results, memory).run())


class _Chain:
    """The stages of the one case of a cohort, and the artefacts that they have left."""

    def __init__(self, cohort: Cohort, results: Path, memory: Memory) -> None:
        self.cohort, self.results, self.memory = cohort, results, memory
        ((self.case, self.row),) = cohort.cases.items()
        self.views = cohort.views(self.case)
        self.done: dict[str, list[Done]] = {}

    def run(self) -> dict[str, list[Artefact]]:
        for stage in CHAIN:
            for view in self.views if stage in VIEW_STAGES else (None,):
                self.done.setdefault(stage, []).append(self._one(stage, view))
        return {stage: [Artefact(done.path) for done in found] for stage, found in self.done.items()}

    def _one(self, stage: str, view: str | None) -> Done:
        artefacts, files = self._inputs(stage, view)
        subject, settings = self._subject(view), dict(SETTINGS.get(stage, {}))
        given = {name: [done.content for done in found] for name, found in artefacts.items()}
        given |= {name: [content_id(path), path.is_dir(), *path.suffixes[-2:]] for name, path in files.items()}
        key = hashlib.sha256(json.dumps([stage, settings, asdict(subject), given]).encode()).hexdigest()
        if key not in self.memory:
            output = self.results / (f"{stage}.{view}.h5" if view else f"{stage}.h5")
            paths = {name: [done.path for done in found] for name, found in artefacts.items()}
            fields = run_stage(stage, {**paths, **files}, output, settings, subject)
            self.memory[key] = Done(output, _content(fields))
        return self.memory[key]

    def _subject(self, view: str | None) -> Subject:
        mammogram = self.cohort.mammograms.get((self.case, view or ""))
        row = self.row.values() | (mammogram.values() if mammogram else {})
        return Subject(self.case, self.row.laterality, view, row)

    def _inputs(self, stage: str, view: str | None) -> tuple[dict[str, list[Done]], dict[str, Path]]:
        """What the stage's record declares and the case has, as the workflow's rules hand it over."""
        record, files = load_stage(stage), dict(self._files(view))
        names = (*record.inputs, *record.optional)
        return (
            {name: self._made(name, view) for name in names if self.done.get(name)},
            {name: files[name] for name in names if name not in STAGE_MODULES and name in files},
        )

    def _made(self, stage: str, view: str | None) -> list[Done]:
        found = self.done[stage]
        return found if view is None or stage not in VIEW_STAGES else [found[self.views.index(view)]]

    def _files(self, view: str | None) -> Iterator[tuple[str, Path]]:
        yield from self.row.files().items()
        for name in self.views:
            mammogram = self.cohort.mammograms.get((self.case, name))
            if mammogram and view in (None, name):
                yield from ((c if view else f"{c}_{name}", path) for c, path in mammogram.files().items())


def _content(fields: Fields) -> str:
    digest = hashlib.sha256()
    for name, array in fields.arrays.items():
        digest.update(f"{name} {array.units} {array.data.dtype} {array.data.shape}".encode())
        digest.update(np.ascontiguousarray(array.data).tobytes())
    for name, item in fields.volumes.items():
        volume = item.volume
        digest.update(f"{name} {volume.data.dtype} {volume.data.shape} {volume.origin} {volume.spacing}".encode())
        digest.update(np.ascontiguousarray(volume.data).tobytes())
    digest.update(json.dumps([dict(fields.values), repr(fields.failure)], default=_jsonable, sort_keys=True).encode())
    return digest.hexdigest()


def _jsonable(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)


def _outcome(made: dict[str, list[Artefact]]) -> Outcome:
    localize, evaluate = made["localize"][0], made["evaluate"][0]
    rows = evaluate.value("view_rows") if evaluate.has("view_rows") else []
    outcome = Outcome("ok")
    failures = [a.failure for found_ in made.values() for a in found_ if a.failure]
    if failures:
        ended = "bug" if any(failure.status == "bug" for failure in failures) else "failed"
        outcome = Outcome(ended, str(next((f for f in failures if f.status == "bug"), failures[0])))
    for row in (row for row in rows if row["method"] == METHOD):
        outcome.flags[str(row["view"])] = str(row["trust"])
        outcome.estimated[str(row["view"])] = str(row["estimated"])
    for pose in (PoseRecord(a) for a in made.get("pose", []) if a.ok):
        geometry = pose.geometry
        outcome.scale_mm[pose.view] = geometry.pixel_mm / geometry.middle_magnification
    outcome.marks_differ = list(evaluate.value("warnings")) if evaluate.has("warnings") else []
    _note_marks(outcome, Predictions(localize))
    return outcome


def _note_marks(outcome: Outcome, found: Predictions) -> None:
    for row in (row for row in found.mammogram_rows if row.method == METHOD):
        if row.seen:
            outcome.marks.setdefault(row.view, {})[row.name] = [float(x) for x in row.pixel]
        elif row.message:
            outcome.flags[f"{row.view} {row.name}"] = row.message
    for place in (row for row in found.mr_rows if row.method == METHOD):
        if place.x is not None:
            outcome.marks.setdefault("MR", {})[place.name] = [float(x) for x in place.point]
        if place.message:
            outcome.flags[f"MR {place.name}"] = place.message
