"""What a stage is: a name, its inputs, a settings model and one function from these to fields."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, JsonValue

from mammoreg.geometry.frames import Laterality
from stages.engine.artefact import Array, Artefact, Fields, Value, VolumeField
from stages.engine.failures import Failure

__all__ = [
    "Array",
    "Artefact",
    "Failure",
    "Fields",
    "Inputs",
    "Laterality",
    "NoSettings",
    "SettingsModel",
    "SharedSettings",
    "Stage",
    "Subject",
    "Value",
    "VolumeField",
    "source",
]


class SettingsModel(BaseModel):
    """Base of every stage's settings: unknown keys are errors, and nothing changes after validation."""

    # Infinity becomes a text that is read back: JSON has no such number.
    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="strings")

    def plain(self) -> dict[str, Any]:
        """The settings in JSON types, as artefacts keep them."""
        return dict(json.loads(self.model_dump_json()))


def source(text: str) -> dict[str, JsonValue]:
    """Where a default comes from, for `json_schema_extra`: a reference, or the word chosen and for what.

    config.yaml and config/README.md show it.
    """
    return {"source": text}


class NoSettings(SettingsModel):
    """Settings of a stage that has none."""


class SharedSettings(SettingsModel):
    """Base of settings that several stages read.

    A stage's field of such a type is a section of the configuration of its own, under the field's name. Each stage's
    type holds the keys that count for it; the section has those of the stage that reads most, which extends the others.
    """


@dataclass(frozen=True)
class Subject:
    """What a stage works on.

    Attributes:
        case: id of the case, or "cohort" for a stage that runs once for all.
        laterality: side of the breast (of a cohort's stage: without meaning).
        view: a mammogram's view (CC, MLO, ML, ...) or 3D for a stage that runs once per view.
        row: the tables' columns that are values, not files, such as `thickness_mm`; empty cells are left out.
    """

    case: str
    laterality: Laterality = "R"
    view: str | None = None
    row: Mapping[str, str] = field(default_factory=dict)

    def number(self, column: str) -> float | None:
        """A column of the row as a number, None where the cell is empty."""
        text = self.row.get(column, "")
        return float(text) if text else None


@dataclass(frozen=True)
class Inputs:
    """The files and artefacts that a stage was given, by the names that its `Stage` declares."""

    files: Mapping[str, Path] = field(default_factory=dict)
    stages: Mapping[str, Sequence[Artefact]] = field(default_factory=dict)

    def has(self, name: str) -> bool:
        """Whether an input of that name was given."""
        return name in self.files or bool(self.stages.get(name))

    def path(self, name: str) -> Path | None:
        """A file, None where the table names none."""
        return self.files.get(name)

    def artefact(self, name: str) -> Artefact:
        """The one artefact of a stage."""
        (artefact,) = self.stages[name]
        return artefact

    def artefacts(self, name: str) -> list[Artefact]:
        """All artefacts of a stage that were given, one per view (and case)."""
        return list(self.stages.get(name, ()))


@dataclass(frozen=True)
class Stage:
    """One stage of the pipeline.

    Attributes:
        name: as the rule, the settings section and the artefact are called.
        schema: version of the artefact's contents.
        inputs: names that must be given; the name of a stage stands for its artefact, any other for a file.
        settings: the model of its section of the configuration.
        run: the stage itself.
        optional: names that may be given.
        takes_failed: whether it is called with artefacts whose status is not ok; otherwise the first one's failure is
            passed on without calling it.
        folder: where `Fields.files` go, relative to the artefact's folder; default the stage's name.
        without_result: the values that stand in an artefact without result, such as rows that name what is missing.
    """

    name: str
    schema: int
    inputs: tuple[str, ...]
    settings: type[BaseModel]
    run: Callable[[Inputs, Any, Subject], Fields]
    optional: tuple[str, ...] = ()
    takes_failed: bool = False
    folder: str | None = None
    without_result: Callable[[Inputs, Failure], Mapping[str, Value]] | None = None
