"""The whole configuration: the cohort's tables, where results go, and the settings that stages share and their own."""

import difflib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from stages.engine.contract import SettingsModel, SharedSettings
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
    """Model of the configuration in the pipeline's order: `CohortKeys`, shared sections, one per stage with settings.

    A shared section stands before the first stage that reads it.
    """
    sections: dict[str, Any] = {}
    for name in STAGE_MODULES:
        for shared, model in _shared(name).items():
            readers = {stage: _shared(stage)[shared] for stage in STAGE_MODULES if shared in _shared(stage)}
            widest = max(readers.values(), key=lambda m: len(m.model_fields))
            if not issubclass(widest, model):
                raise TypeError(f"keys of {model.__name__} are missing in {widest.__name__}")
            sections.setdefault(shared, _section(widest, f"{_first_line(widest)} {_who_reads(readers, widest)}"))
        own = _own(name)
        if own.model_fields:
            sections[name] = _section(own, f"Stage `{name}`: {_first_line(own, lower=True)}")
    return create_model("Config", __base__=CohortKeys, **sections)


def _section(model: type[BaseModel], description: str) -> tuple[type[BaseModel], Any]:
    return model, Field(default_factory=model, description=description)


def _first_line(model: type[BaseModel], *, lower: bool = False) -> str:
    text = (model.__doc__ or "").partition("\n")[0]
    return text[:1].lower() + text[1:] if lower else text


def _who_reads(readers: Mapping[str, type[SharedSettings]], widest: type[SharedSettings]) -> str:
    """Which stages read a shared section, and what some of them do not."""
    texts = []
    for stage, model in readers.items():
        left = ", ".join(key for key in widest.model_fields if key not in model.model_fields)
        texts.append(f"`{stage}`" + (f" (but for {left})" if left else ""))
    return f"Read by {' and '.join(texts)}."


def _shared(stage: str) -> dict[str, type[SharedSettings]]:
    """The shared sections that a stage reads, by name."""
    annotations = {key: info.annotation for key, info in load_stage(stage).settings.model_fields.items()}
    return {key: a for key, a in annotations.items() if isinstance(a, type) and issubclass(a, SharedSettings)}


@cache
def _own(stage: str) -> type[BaseModel]:
    """A stage's settings without the shared ones."""
    settings, shared = load_stage(stage).settings, _shared(stage)
    if not shared:
        return settings
    keys: dict[str, Any] = {k: (i.annotation, i) for k, i in settings.model_fields.items() if k not in shared}
    return create_model(f"{stage.title()}Section", __base__=SettingsModel, __doc__=settings.__doc__, **keys)


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
        raise FaultsError(f for detail in error.errors() for f in _faults(dict(detail))) from error
    if config.views is not None and config.cases is None:
        raise FaultsError([Fault("config, key views", "is given without cases", "give cases=<cases.tsv> as well")])
    return config


def stage_settings(config: CohortKeys, name: str) -> dict[str, Any]:
    """The settings of one stage in JSON types: its own and, of the shared ones, those that it reads."""
    section = getattr(config, name, None)
    own = section.model_dump(mode="json") if isinstance(section, BaseModel) else {}
    shared = {
        key: getattr(config, key).model_dump(mode="json", include=set(model.model_fields))
        for key, model in _shared(name).items()
    }
    return own | shared


def _faults(detail: Mapping[str, Any]) -> list[Fault]:
    """A pydantic error in the words of the configuration's user."""
    keys = [str(key) for key in detail["loc"]]
    if detail["type"] == "extra_forbidden" and len(keys) == 2 and _is_shared(keys[1]):
        return _moved(keys[0], keys[1], detail["input"])
    return [_fault(keys, detail)]


def _is_shared(name: str) -> bool:
    return any(name in _shared(stage) for stage in STAGE_MODULES)


def _moved(stage: str, section: str, values: Any) -> list[Fault]:
    """Shared keys that stand in a stage's section, each with its place."""
    known, faults = _known_keys([section]), []
    for key in values if isinstance(values, Mapping) and values else ():
        (near,) = difflib.get_close_matches(str(key), known, n=1, cutoff=0.0)
        remedy = f"write {section}.{near}, which counts for every stage"
        faults.append(Fault(f"config, key {stage}.{section}.{key}", "is unknown", remedy))
    where = f"config, key {stage}.{section}"
    return faults or [Fault(where, "is unknown", f"the section {section} stands beside {stage}, not in it")]


def _fault(keys: list[str], detail: Mapping[str, Any]) -> Fault:
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
