"""The stages by name, in the order of the pipeline."""

import importlib
from typing import cast

from stages.contract import Stage
from stages.digest import module_digest
from stages.errors import UserError

PIPELINE = (
    "digital",
    "segment",
    "mesh",
    "calibrate",
    "pose",
    "compress",
    "shape",
    "solve",
    "project",
    "localize",
    "evaluate",
    "figures",
    "tables",
    "report",
)
STAGE_MODULES = {name: f"stages.{name}" for name in PIPELINE} | {"error_vs_runtime": "stages.studies.runtime"}


def load_stage(name: str) -> Stage:
    """Import a stage's module, and nothing else, and return its record."""
    if name not in STAGE_MODULES:
        raise UserError(f"no stage {name!r}; the stages are {', '.join(STAGE_MODULES)}")
    return cast(Stage, importlib.import_module(STAGE_MODULES[name]).STAGE)


def stage_digest(name: str) -> str:
    """Digest of the code that a stage depends on."""
    return module_digest(STAGE_MODULES[name])
