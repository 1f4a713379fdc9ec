"""Study `runtime`: error and time of each method of one case on meshes of several sizes.

Its rows hold processor times, so that they alone of all artefacts differ from run to run.
"""

import json
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import Field

from stages.artefact import Artefact, Fields
from stages.contract import Inputs, SettingsModel, Stage, Subject
from stages.methods import METHODS
from stages.registry import STAGE_MODULES, VIEW_STAGES, load_stage
from stages.run import run_stage
from stages.studies.comparison import view_results

CHAIN = ("mesh", "pose", "compress", "shape", "solve", "localize", "evaluate")
MECHANICS = {"plate": ("compress",), "updated": ("compress", "shape", "solve")}
_GIVEN = ("segment", "calibrate")
_FILES = ("mr_lesion", "mr_landmarks", "mr_compressed_landmarks")
_VIEW_FILES = ("image", "lesion", "landmarks")
_KIB_PER_MB = 1024.0


class Settings(SettingsModel):
    """Meshes of the study `error_vs_runtime`."""

    elements: tuple[int, ...] = Field((5, 7, 10), min_length=2, description="elements a side of each mesh")


@dataclass(frozen=True)
class Plan:
    """What every mesh of a case runs with: input paths by name, settings and table rows of the main run."""

    subject: Subject
    inputs: Mapping[str, list[Path]]
    settings: Mapping[str, dict[str, Any]]
    rows: Mapping[str, dict[str, str]]


@dataclass
class Run:
    """One mesh's artefacts by stage and processor seconds by (stage, view); view "" for the whole case."""

    elements: int
    artefacts: dict[str, list[Path]] = field(default_factory=dict)
    seconds: dict[tuple[str, str], float] = field(default_factory=dict)
    peak_mb: float = 0.0


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Run the case once per mesh and compare predictions with the truth and with the finest mesh."""
    plan = _plan(inputs, subject)
    with tempfile.TemporaryDirectory() as folder:
        runs = [_in_own_process(plan, n, Path(folder) / str(n)) for n in sorted(settings.elements)]
        rows = [row for one in runs for row in _rows(plan, one, runs[-1])]
    return Fields(values={"rows": rows})


def _plan(inputs: Inputs, subject: Subject) -> Plan:
    """The main run's own settings, so that the study differs from it by the mesh alone."""
    artefacts = {name: inputs.artefacts(name) for name in (*_GIVEN, *CHAIN)}
    settings = {name: json.loads(found[0].attrs["settings"]) for name, found in artefacts.items() if found}
    rows = {str(pose.view): json.loads(pose.attrs["row"]) for pose in artefacts["pose"]}
    paths = {name: [a.path for a in artefacts[name]] for name in _GIVEN if artefacts[name]}
    paths |= {name: [path] for name, path in inputs.files.items()}
    return Plan(subject, paths, settings, dict(sorted(rows.items())))


def _in_own_process(plan: Plan, elements: int, folder: Path) -> Run:
    """A process of its own, so that its memory is that of this mesh."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        return pool.submit(_run_chain, plan, elements, folder).result()


def _run_chain(plan: Plan, elements: int, folder: Path) -> Run:
    done = Run(elements)
    for stage in CHAIN:
        for view in plan.rows if stage in VIEW_STAGES else ("",):
            output = folder / (f"{stage}.{view}.h5" if view else f"{stage}.h5")
            settings = dict(plan.settings.get(stage, {}))
            if stage == "mesh":
                settings["elements"] = elements
            subject = Subject(
                plan.subject.case,
                plan.subject.laterality,
                view or None,
                plan.rows[view] if view else plan.subject.row,
            )
            start = time.process_time()
            run_stage(stage, _inputs_of(stage, view, plan, done), output, settings, subject)
            done.seconds[stage, view] = time.process_time() - start
            done.artefacts.setdefault(stage, []).append(output)
    done.peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB_PER_MB
    return done


def _inputs_of(stage: str, view: str, plan: Plan, done: Run) -> dict[str, Sequence[Path]]:
    """What a stage takes: artefacts of this mesh, and the main run's for what the mesh does not change."""
    record, found = load_stage(stage), dict[str, Sequence[Path]]()
    for name in (*record.inputs, *record.optional):
        if name in STAGE_MODULES:
            paths = done.artefacts.get(name, plan.inputs.get(name, []))
            found[name] = [p for p in paths if not view or name not in VIEW_STAGES or p.name == f"{name}.{view}.h5"]
        else:
            found[name] = plan.inputs.get(f"{name}_{view}" if view and name in _VIEW_FILES else name, [])
    return {name: paths for name, paths in found.items() if paths}


def _rows(plan: Plan, one: Run, finest: Run) -> list[dict[str, Any]]:
    """Rows of one mesh without the column `case`."""
    rows = []
    for view in plan.rows:
        results = view_results(view, *(_opened(run, view) for run in (one, finest)))
        for method in METHODS:
            error, discretisation = results.get(method, (None, None))
            solve = sum(one.seconds[stage, view] for stage in MECHANICS.get(method, ()))
            total = one.seconds["mesh", ""] + one.seconds["pose", view] + solve
            rows.append(
                {
                    "view": view,
                    "method": method,
                    "material": _material(plan),
                    "elements": one.elements,
                    "error_mm": error,
                    "discretisation_mm": discretisation,
                    "solve_s": solve,
                    "total_s": total,
                    "peak_mb": one.peak_mb,
                    "failed": method not in results,
                }
            )
    return rows


def _opened(one: Run, view: str) -> dict[str, Artefact]:
    """Artefacts of one mesh that tell about a view."""
    wanted = {"localize": "localize.h5", "evaluate": "evaluate.h5", "pose": f"pose.{view}.h5"}
    paths = {path.name: path for found in one.artefacts.values() for path in found}
    return {stage: Artefact(paths[name]) for stage, name in wanted.items()}


def _material(plan: Plan) -> str:
    """The material of the main run in words."""
    mechanics = plan.settings.get("compress", {}).get("mechanics", {})
    tissue = "homogeneous" if mechanics.get("gland_contrast", 1.0) == 1.0 else "gland and fat"
    return f"{tissue} neo-Hookean{' with fibres' if mechanics.get('fibre_ratio', 0.0) else ''}"


STAGE = Stage(
    name="runtime",
    schema=1,
    inputs=("segment", "pose"),
    optional=(
        "calibrate",
        *(stage for stage in CHAIN if stage != "pose"),
        *_FILES,
        *(f"{name}_{view}" for name in _VIEW_FILES for view in ("CC", "MLO")),
    ),
    settings=Settings,
    run=run,
    takes_failed=True,
)
