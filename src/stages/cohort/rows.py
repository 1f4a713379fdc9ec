"""From a table's text to checked rows, with every fault in the words of the table's user."""

import difflib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from stages.cohort.readers.table import Table, TableError, read_table
from stages.engine.errors import Fault


class Row(BaseModel):
    """A row of a table."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def files(self) -> dict[str, Path]:
        """The files that the row names, by column."""
        return {name: value for name, value in self if isinstance(value, Path)}


AnyRow = TypeVar("AnyRow", bound=Row)


def looks_like(path: Path, model: type[Row], other: type[Row]) -> bool:
    """Whether a table has the required columns of the other model and not those of the first."""
    try:
        columns = set(read_table(path, set(other.model_fields)).header)
    except TableError:
        return False
    return _required(other) <= columns and not _required(model) <= columns


def read_rows(
    path: Path, model: type[AnyRow], files_in: Path | None, faults: list[Fault]
) -> tuple[list[tuple[int, AnyRow]], set[str]]:
    """Good rows of a table with their row numbers, and the ids of all; what is wrong is added to `faults`.

    Args:
        path: the table.
        model: of its rows.
        files_in: folder that its paths are relative to; None: its own.
        faults: list to add to.
    """
    try:
        table = read_table(path, set(model.model_fields))
    except TableError as error:
        faults.append(Fault(str(path), f"cannot be read ({error})", "give a tab-separated table in UTF-8"))
        return [], set()
    header = table.header
    faults += _header_faults(path, table, model)
    if _required(model) - set(header) or len(set(header)) < len(header):
        return [], set()
    column = header.index("case")
    folder = path.parent if files_in is None else files_in
    found = [(number, _row(path, number, header, line, model, folder, faults)) for number, line in table.rows]
    return [(n, row) for n, row in found if row], {line[column] for _, line in table.rows if column < len(line)}


def _header_faults(path: Path, table: Table, model: type[Row]) -> list[Fault]:
    columns, where, header = list(model.model_fields), f"{path.name} row 1", table.header
    faults = []
    for name in header:
        if not name:
            faults.append(Fault(where, "a column with cells has no name", "name it or empty its cells"))
        elif name not in columns:
            near = difflib.get_close_matches(name.lower(), columns, n=1, cutoff=0.0)[0]
            faults.append(Fault(where, f"unknown column {name!r}", f"the nearest known one is {near!r}"))
    for name in sorted({name for name in header if name and header.count(name) > 1}):
        faults.append(Fault(where, f"column {name!r} is there twice", "keep one of them"))
    for name in (name for name in columns if name in _required(model) and name not in header):
        remedy = "add it, and separate columns by tabs" if len(header) < 2 else "add it"
        faults.append(Fault(where, f"the required column {name!r} is missing", remedy))
    return faults


def _required(model: type[Row]) -> set[str]:
    return {name for name, info in model.model_fields.items() if info.is_required()}


def _row(
    path: Path,
    number: int,
    header: Sequence[str],
    line: Sequence[str],
    model: type[AnyRow],
    folder: Path,
    faults: list[Fault],
) -> AnyRow | None:
    where = f"{path.name} row {number} ({line[0]})"
    if len(line) > len(header) and any(line[len(header) :]):
        what = f"{len(line)} cells under {len(header)} columns"
        faults.append(Fault(where, what, "remove the surplus, or give each cell a column"))
        return None
    cells = {name: cell for name, cell in zip(header, line, strict=False) if cell and name in model.model_fields}
    for name, info in model.model_fields.items():
        if name in cells and info.annotation in (Path, Path | None):
            cells[name] = os.path.normpath(folder / cells[name])
    try:
        return model.model_validate(cells)
    except ValidationError as error:
        faults += [_fault(where, model, dict(detail)) for detail in error.errors()]
        return None


def _fault(where: str, model: type[Row], detail: Mapping[str, Any]) -> Fault:
    """A pydantic error in the words of the table's user."""
    column = str(detail["loc"][0])
    meaning = model.model_fields[column].description or ""
    if detail["type"] == "missing":
        return Fault(f"{where}, column {column}", "is empty", f"give it: {meaning}")
    what = f"{detail['input']!r} is not permitted: {detail['msg'].removeprefix('Value error, ')}"
    return Fault(f"{where}, column {column}", what, f"it is the {meaning}" if meaning else "correct it")
