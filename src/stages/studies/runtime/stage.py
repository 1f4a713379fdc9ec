"""Study `runtime`: error and time of each method of one case on meshes of several sizes.

Its rows hold processor times, so that they alone of all artefacts differ from run to run.
"""

import multiprocessing
import resource
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field

from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Inputs, SettingsModel, Stage, Subject
from stages.methods import METHODS
from stages.studies.chain import Done, Plan, plan_of, run_chain
from stages.studies.runtime.comparison import view_results
from stages.views import IMAGED

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
class Run:
    """One mesh: its elements a side, what ran, and the most memory that it took."""

    elements: int
    done: Done
    peak_mb: float


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Run the case once per mesh and compare predictions with the truth and with the finest mesh."""
    plan = plan_of(inputs, subject, _GIVEN, CHAIN)
    with tempfile.TemporaryDirectory() as folder:
        runs = [_in_own_process(plan, n, Path(folder) / str(n)) for n in sorted(settings.elements)]
        rows = [row for one in runs for row in _rows(plan, one, runs[-1])]
    return Fields(values={"rows": rows})


def _in_own_process(plan: Plan, elements: int, folder: Path) -> Run:
    """A process of its own, so that its memory is that of this mesh."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        return pool.submit(_run_mesh, plan, elements, folder).result()


def _run_mesh(plan: Plan, elements: int, folder: Path) -> Run:
    done = run_chain(plan, CHAIN, folder, {"mesh": {"elements": elements}})
    return Run(elements, done, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB_PER_MB)


def _rows(plan: Plan, one: Run, finest: Run) -> list[dict[str, Any]]:
    """Rows of one mesh without the column `case`."""
    rows = []
    for view in plan.rows:
        results = view_results(view, *(_opened(run, view) for run in (one, finest)))
        for method in METHODS:
            error, discretisation = results.get(method, (None, None))
            solve = sum(one.done.seconds[stage, view] for stage in MECHANICS.get(method, ()))
            total = one.done.seconds["mesh", ""] + one.done.seconds["pose", view] + solve
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
    paths = {path.name: path for found in one.done.artefacts.values() for path in found}
    return {stage: Artefact(paths[name]) for stage, name in wanted.items()}


def _material(plan: Plan) -> str:
    """The material of the main run in words."""
    mechanics = plan.settings.get("compress", {}).get("mechanics", {})
    model = mechanics.get("material", "homogeneous")
    words = {"homogeneous": "homogeneous neo-Hookean", "fat_and_gland": "fat and gland neo-Hookean"}
    tissue = words.get(model, model)
    return f"{tissue}{' with fibres' if mechanics.get('fibre_ratio', 0.0) else ''}"


STAGE = Stage(
    name="runtime",
    schema=1,
    inputs=("segment", "pose"),
    optional=(
        "calibrate",
        *(stage for stage in CHAIN if stage != "pose"),
        *_FILES,
        *(f"{name}_{view}" for name in _VIEW_FILES for view in IMAGED),
    ),
    settings=Settings,
    run=run,
    takes_failed=True,
)
