"""The stages by name and by what they run for: a case, a view of a case, or the cohort."""

import importlib
from typing import cast

from stages.engine.contract import Stage
from stages.engine.digest import module_digest
from stages.engine.errors import UserError

CASE_STAGES = ("segment", "mesh", "localize", "evaluate", "figures")
VIEW_STAGES = ("pose", "compress", "shape", "solve", "project")
COHORT_STAGES = ("calibrate", "tables", "report")
# Module below `stages.studies` and what the study runs for.
_STUDIES = {
    "runtime": ("runtime.stage", "case"),
    "error_vs_runtime": ("runtime.error_vs_runtime", "cohort"),
    "table_1": ("table_1.stage", "cohort"),
    "volunteer": ("volunteer.stage", "case"),
    "paper_tables": ("volunteer.paper_tables", "cohort"),
    "stability_scan_mesh": ("stability.scan_mesh", "cohort"),
    "stability_batch": ("stability.batch", "cohort"),
    "stability": ("stability.stage", "cohort"),
}
STUDIES = {name: scope for name, (_, scope) in _STUDIES.items()}
# The order in which a run goes through them, and in which their keys stand in the configuration.
_PIPELINE = (
    *("digital", "segment", "mesh", "calibrate", "pose", "compress", "shape", "solve", "project"),
    *("localize", "evaluate", "figures", "tables", "report"),
)
STAGE_MODULES = {name: f"stages.{name}.stage" for name in _PIPELINE} | {
    name: f"stages.studies.{module}" for name, (module, _) in _STUDIES.items()
}


def runs_for_one_case(name: str) -> bool:
    """Whether a stage of the pipeline works on one case, whose trouble is no other's."""
    return name in CASE_STAGES or name in VIEW_STAGES


def load_stage(name: str) -> Stage:
    """Import a stage's module, and nothing else, and return its record."""
    if name not in STAGE_MODULES:
        raise UserError(f"no stage {name!r}; the stages are {', '.join(STAGE_MODULES)}")
    return cast(Stage, importlib.import_module(STAGE_MODULES[name]).STAGE)


def stage_digest(name: str) -> str:
    """Digest of the code that a stage depends on."""
    return module_digest(STAGE_MODULES[name])
