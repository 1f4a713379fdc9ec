"""What is written from the pydantic models: schemas, config.yaml and the tables of config/README.md.

`make generated` writes them; a test keeps them equal to the models.
"""

import json
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from stages.code_numbers import code_numbers
from stages.cohort.cases import CaseRow, ViewRow
from stages.engine.config import config_model

WIDTH = 116
LONGEST = 60


def reference_files(project: Path) -> dict[Path, str]:
    """Texts by path; the hand-written part of config/README.md is kept.

    Args:
        project: root of the project.
    """
    readme = project / "config" / "README.md"
    models: dict[str, type[BaseModel]] = {"config": config_model(), "cases": CaseRow, "views": ViewRow}
    files = {
        project / "workflow" / "schemas" / f"{name}.schema.json": json.dumps(model.model_json_schema(), indent=2) + "\n"
        for name, model in models.items()
    }
    files[project / "config" / "config.yaml"] = config_yaml()
    files[readme] = _with_tables(readme.read_text(encoding="utf-8"))
    return files


def config_yaml() -> str:
    """The default configuration, each key under a comment that says what it means."""
    head = "# Defaults of every key; change them here, in a file given with --configfile, or with --config key=value.\n"
    return head + "".join(_yaml_lines(config_model(), config_model()(), ""))


def _yaml_lines(model: type[BaseModel], defaults: BaseModel, indent: str) -> Iterator[str]:
    for name, info in model.model_fields.items():
        value = getattr(defaults, name)
        yield "\n" if not indent else ""
        yield (
            textwrap.fill(
                _meaning(info) + _origin(info), WIDTH, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# "
            )
            + "\n"
        )
        if isinstance(value, BaseModel):
            yield f"{indent}{name}:\n"
            yield from _yaml_lines(type(value), value, indent + "  ")
        else:
            yield textwrap.indent(_entry(name, _json(defaults)[name]), indent)


def _entry(name: str, value: Any) -> str:
    """A key and its value: lists and the innermost mappings on one line."""
    return yaml.safe_dump(
        {name: value}, default_flow_style=None if isinstance(value, dict | list) else False, width=WIDTH
    )


def _meaning(info: FieldInfo) -> str:
    """Description, bounds and permitted values of a key."""
    bounds = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
    limits = [f"{sign} {getattr(m, key)}" for m in info.metadata for key, sign in bounds.items() if hasattr(m, key)]
    choices = _choices(info.annotation)
    extra = [*limits, *([" | ".join(choices)] if choices else [])]
    return (info.description or "") + (f" ({', '.join(extra)})" if extra else "")


def _source(info: FieldInfo) -> str:
    """Where a key's default comes from, empty where its model does not say."""
    extra = info.json_schema_extra
    return str(extra.get("source", "")) if isinstance(extra, dict) else ""


def _origin(info: FieldInfo) -> str:
    return f"; {_source(info)}" if _source(info) else ""


def _choices(annotation: Any) -> list[str]:
    """Permitted values of an annotation that holds literals, however nested."""
    if get_origin(annotation) is Literal:
        return [str(value) for value in get_args(annotation)]
    return [choice for part in get_args(annotation) for choice in _choices(part)]


def _with_tables(readme: str) -> str:
    """The README with the part between each pair of markers made anew."""
    parts = {"cases": _columns(CaseRow), "views": _columns(ViewRow), "keys": _keys(), "sources": _sources()}
    for name, text in parts.items():
        pattern = rf"(?<=<!-- {name} -->\n).*?(?=<!-- end -->)"
        readme = re.sub(pattern, text.replace("\\", r"\\"), readme, count=1, flags=re.DOTALL)
    return readme


def _columns(model: type[BaseModel]) -> str:
    rows = [(f"`{n}`", "yes" if i.is_required() else "no", _meaning(i)) for n, i in model.model_fields.items()]
    return _table(("column", "required", "meaning"), rows)


def _keys() -> str:
    return _table(("key", "default", "meaning"), list(_key_rows(config_model(), config_model()(), "")))


def _sources() -> str:
    """Keys whose model says where the default comes from, then numbers in the code."""
    keys = [(key, value, _source(info)) for key, value, info in _key_infos(config_model(), config_model()(), "")]
    code = [(f"`{place}`", f"`{value}`", comment) for place, value, comment in code_numbers()]
    return _table(("number", "value", "where from"), [*(row for row in keys if row[2]), *code])


def _key_rows(model: type[BaseModel], defaults: BaseModel, prefix: str) -> Iterator[tuple[str, ...]]:
    for key, value, info in _key_infos(model, defaults, prefix):
        yield key, value, _meaning(info)


def _key_infos(model: type[BaseModel], defaults: BaseModel, prefix: str) -> Iterator[tuple[str, str, FieldInfo]]:
    """Each key with its sections, its default as text, and what the model knows of it."""
    for name, info in model.model_fields.items():
        value = getattr(defaults, name)
        if isinstance(value, BaseModel):
            yield from _key_infos(type(value), value, f"{prefix}{name}.")
        else:
            text = json.dumps(_json(defaults)[name])
            yield f"`{prefix}{name}`", f"`{text}`" if len(text) <= LONGEST else "see config.yaml", info


def _json(model: BaseModel) -> Mapping[str, Any]:
    return model.model_dump(mode="json")


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


if __name__ == "__main__":
    for path, text in reference_files(Path(sys.argv[1] if len(sys.argv) > 1 else ".")).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
