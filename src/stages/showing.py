"""An artefact as a person reads it."""

import json
from collections.abc import Iterator

from stages.engine.artefact import Artefact
from stages.engine.text import value_lines


def describe(artefact: Artefact) -> str:
    """How a stage ended, its values (predictions as tables), arrays and volumes, and what made them."""
    attrs = artefact.attrs
    lines = [f"{artefact.stage} of {_subject(artefact)}: {artefact.status}"]
    lines += [f"  {artefact.message}"] if artefact.message else []
    lines += ["values", *value_lines({name: artefact.value(name) for name in artefact.value_names()})]
    lines += ["arrays", *_arrays(artefact), "volumes", *_volumes(artefact)]
    lines += [f"frame {attrs['frame']}", f"settings {attrs['settings']}", f"row {attrs['row']}"]
    lines += ["inputs " + (", ".join(json.loads(attrs["inputs"])) or "none")]
    lines += [f"package {attrs['package_version']}, schema {attrs['schema']}, code {attrs['code'][:12]}"]
    lines += ["software " + ", ".join(f"{k} {v}" for k, v in json.loads(attrs.get("software", "{}")).items())]
    return "\n".join(lines)


def _subject(artefact: Artefact) -> str:
    """Case, view and side; a cohort has no side."""
    if artefact.case == "cohort":
        return "the cohort"
    return " ".join(part for part in (artefact.case, artefact.view or "", f"({artefact.laterality})") if part)


def _arrays(artefact: Artefact) -> Iterator[str]:
    for name, shape, texts in artefact.listing("arrays"):
        data = artefact.array(name, texts["units"])
        span = f", {data.min():.6g} to {data.max():.6g}" if data.size else ""
        yield f"  {name} {_size(shape)} {texts['units']}{span}: {texts['long_name']}"


def _volumes(artefact: Artefact) -> Iterator[str]:
    for name, shape, texts in artefact.listing("volumes"):
        if texts.get("frame"):
            where, units = name.rpartition("/")[0], texts["units"]
            yield f"  {where} {_size(shape)} {units} ({texts['frame']}): {texts['long_name']}"


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(str(n) for n in shape) or "scalar"
