"""The stages by name and by what they run for: a case, a view of a case, or the cohort."""

import importlib
from typing import cast

from stages.contract import Stage
from stages.digest import module_digest
from stages.errors import UserError

CASE_STAGES = ("segment", "mesh", "localize", "evaluate", "figures")
VIEW_STAGES = ("pose", "compress", "shape", "solve", "project")
COHORT_STAGES = ("calibrate", "tables", "report")
STUDIES = {
    "runtime": "case",
    "error_vs_runtime": "cohort",
    "table_1": "cohort",
    "volunteer": "case",
    "paper_tables": "cohort",
    **dict.fromkeys(("stability_scan_mesh", "stability_batch", "stability"), "cohort"),
}
STAGE_MODULES = {name: f"stages.{name}" for name in ("digital", *CASE_STAGES, *VIEW_STAGES, *COHORT_STAGES)} | {
    name: f"stages.studies.{name}" for name in STUDIES
}


def load_stage(name: str) -> Stage:
    """Import a stage's module, and nothing else, and return its record."""
    if name not in STAGE_MODULES:
        raise UserError(f"no stage {name!r}; the stages are {', '.join(STAGE_MODULES)}")
    return cast(Stage, importlib.import_module(STAGE_MODULES[name]).STAGE)


def stage_digest(name: str) -> str:
    """Digest of the code that a stage depends on."""
    return module_digest(STAGE_MODULES[name])
