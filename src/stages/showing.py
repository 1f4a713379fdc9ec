"""An artefact as a person reads it."""

import json
from collections.abc import Iterator

from stages.engine.artefact import Artefact

LONGEST = 100


def describe(artefact: Artefact) -> str:
    """Status, settings, arrays, volumes and values of an artefact, one a line."""
    attrs = artefact.attrs
    what = " ".join(part for part in (artefact.case, artefact.view or "", f"({artefact.laterality})") if part)
    lines = [f"{artefact.stage} of {what}: {artefact.status}"]
    lines += [f"  {artefact.message}"] if artefact.message else []
    lines += [f"package {attrs['package_version']}, schema {attrs['schema']}, code {attrs['code'][:12]}"]
    lines += ["software " + ", ".join(f"{k} {v}" for k, v in json.loads(attrs.get("software", "{}")).items())]
    lines += [f"frame {attrs['frame']}", f"settings {attrs['settings']}", f"row {attrs['row']}"]
    lines += ["inputs " + (", ".join(json.loads(attrs["inputs"])) or "none")]
    lines += ["arrays", *_arrays(artefact), "volumes", *_volumes(artefact), "values", *_values(artefact)]
    return "\n".join(lines)


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


def _values(artefact: Artefact) -> Iterator[str]:
    for name in artefact.value_names():
        text = json.dumps(artefact.value(name), ensure_ascii=False)
        yield f"  {name} = {text if len(text) <= LONGEST else text[:LONGEST] + ' ...'}"


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(str(n) for n in shape) or "scalar"
