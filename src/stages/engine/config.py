"""The whole configuration: the cohort's tables, where results go, and each stage's own settings."""

import difflib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from stages.engine.errors import Fault, FaultsError
from stages.engine.registry import STAGE_MODULES, load_stage

EMBEDDED = Path("config/digital")


class CohortKeys(BaseModel):
    """The keys that say which cohort runs and where its results go."""

    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)

    cases: str | None = Field(None, description="Table of the cases; null: the embedded digital cohort.")
    views: str | None = Field(
        None, description="Table of the mammograms; null beside `cases`: a cohort without mammograms."
    )
    results: str = Field("results", min_length=1, description="Folder for all results.")
    stability_scan: str | None = Field(
        None,
        min_length=1,
        description="MR volume (NIfTI, or a folder that holds one DICOM series) whose breast is one of the shapes of "
        "the study `stability`; null: its scenarios are listed as not run.",
    )

    def table_files(self, project: Path) -> tuple[Path, Path | None]:
        """Both tables; those of the embedded cohort lie in the project's folder."""
        if self.cases is None:
            return project / EMBEDDED / "cases.tsv", project / EMBEDDED / "views.tsv"
        return Path(self.cases), Path(self.views) if self.views is not None else None


@cache
def config_model() -> type[CohortKeys]:
    """Model of the configuration: `CohortKeys` and one section per stage that has settings."""
    sections: dict[str, Any] = {}
    for name in STAGE_MODULES:
        settings = load_stage(name).settings
        if settings.model_fields:
            sections[name] = (settings, Field(default_factory=settings, description=f"Stage `{name}`."))
    return create_model("Config", __base__=CohortKeys, **sections)


def read_config(values: Mapping[str, Any]) -> CohortKeys:
    """Check a configuration and fill in its defaults.

    Args:
        values: what the configuration files and the command line say.

    Raises:
        FaultsError: all that is wrong, at once.
    """
    try:
        config = config_model().model_validate(dict(values))
    except ValidationError as error:
        raise FaultsError(_fault(dict(detail)) for detail in error.errors()) from error
    if config.views is not None and config.cases is None:
        raise FaultsError([Fault("config, key views", "is given without cases", "give cases=<cases.tsv> as well")])
    return config


def stage_settings(config: CohortKeys, name: str) -> dict[str, Any]:
    """The settings of one stage in JSON types; empty for a stage that has none."""
    section = getattr(config, name, None)
    return section.model_dump(mode="json") if isinstance(section, BaseModel) else {}


def _fault(detail: Mapping[str, Any]) -> Fault:
    """A pydantic error in the words of the configuration's user."""
    keys = [str(key) for key in detail["loc"]]
    where = f"config, key {'.'.join(keys)}"
    if detail["type"] == "extra_forbidden":
        known = _known_keys(keys[:-1])
        near = difflib.get_close_matches(keys[-1], known, n=1, cutoff=0.0)
        return Fault(where, "is unknown", f"the nearest known one is {near[0]!r}" if near else "remove it")
    return Fault(where, f"{detail['input']!r} is not permitted", f"{detail['msg'][0].lower()}{detail['msg'][1:]}")


def _known_keys(keys: list[str]) -> list[str]:
    """Keys that the model knows in the section that `keys` lead to."""
    model: Any = config_model()
    for key in keys:
        info = getattr(model, "model_fields", {}).get(key)
        model = info.annotation if info else None
    return list(getattr(model, "model_fields", {}))
