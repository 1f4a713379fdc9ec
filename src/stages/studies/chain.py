"""Stages of a case run again with other settings than the main run's, by the studies."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stages.engine.contract import Inputs, Subject
from stages.engine.registry import STAGE_MODULES, VIEW_STAGES, load_stage
from stages.engine.run import run_stage
from stages.pose.record import PoseRecord

_VIEW_FILES = ("image", "lesion", "landmarks")


@dataclass(frozen=True)
class Plan:
    """What every variation of a case runs with: input paths by name, settings and table rows of the main run."""

    subject: Subject
    inputs: Mapping[str, list[Path]]
    settings: Mapping[str, dict[str, Any]]
    rows: Mapping[str, dict[str, str]]


@dataclass
class Done:
    """A variation's artefacts by stage and processor seconds by (stage, view); view "" for the whole case."""

    artefacts: dict[str, list[Path]] = field(default_factory=dict)
    seconds: dict[tuple[str, str], float] = field(default_factory=dict)


def plan_of(inputs: Inputs, subject: Subject, given: Sequence[str], again: Sequence[str]) -> Plan:
    """The main run's own settings, so that a study differs from it by what it changes alone.

    Args:
        inputs: of the study.
        subject: the case.
        given: stages whose artefacts are taken from the main run.
        again: stages that run again.
    """
    before = {name: inputs.artefacts(name) for name in again}
    settings = {name: json.loads(found[0].attrs["settings"]) for name, found in before.items() if found}
    rows = {str(pose.view): PoseRecord(pose).row for pose in inputs.artefacts("pose")}
    paths = {name: [a.path for a in inputs.artefacts(name)] for name in given if inputs.has(name)}
    paths |= {name: [path] for name, path in inputs.files.items()}
    return Plan(subject, paths, settings, dict(sorted(rows.items())))


def run_chain(plan: Plan, chain: Sequence[str], folder: Path, changes: Mapping[str, Mapping[str, Any]]) -> Done:
    """Run stages one after the other, for all views of the plan.

    Args:
        plan: what they run with.
        chain: their names.
        folder: for their artefacts.
        changes: settings by stage that differ from the main run's.
    """
    done = Done()
    for stage in chain:
        for view in plan.rows if stage in VIEW_STAGES else ("",):
            output = folder / (f"{stage}.{view}.h5" if view else f"{stage}.h5")
            settings = {**plan.settings.get(stage, {}), **changes.get(stage, {})}
            row = plan.rows[view] if view else plan.subject.row
            subject = Subject(plan.subject.case, plan.subject.laterality, view or None, row)
            start = time.process_time()
            run_stage(stage, _inputs_of(stage, view, plan, done), output, settings, subject)
            done.seconds[stage, view] = time.process_time() - start
            done.artefacts.setdefault(stage, []).append(output)
    return done


def _inputs_of(stage: str, view: str, plan: Plan, done: Done) -> dict[str, Sequence[Path]]:
    """What a stage takes: this variation's artefacts, and the main run's for what it does not change."""
    record, found = load_stage(stage), dict[str, Sequence[Path]]()
    for name in (*record.inputs, *record.optional):
        if name in STAGE_MODULES:
            paths = done.artefacts.get(name, plan.inputs.get(name, []))
            found[name] = [p for p in paths if not view or name not in VIEW_STAGES or p.name == f"{name}.{view}.h5"]
        else:
            found[name] = plan.inputs.get(f"{name}_{view}" if view and name in _VIEW_FILES else name, [])
    return {name: paths for name, paths in found.items() if paths}
