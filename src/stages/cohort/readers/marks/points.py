"""Files that mark places: landmarks and lesions in tables, and in markups of 3D Slicer."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from stages.cohort.readers.marks.markups import ENDINGS, UNKNOWN_DIAMETER_MM, Mark, is_markups, read_marks
from stages.cohort.readers.table import TableError, read_table

Vector = NDArray[np.float64]
MASK_NAME = "lesion"
"""Name of a lesion whose file gives it none."""

_LISTS = (".tsv", ".csv", ".txt", *ENDINGS)
_SLICER_COLUMNS = {"label": "name", "l": "x", "p": "y", "s": "z"}
"""A table of control points that 3D Slicer exports, in LPS."""


def is_list(path: Path) -> bool:
    """Whether a file lists places, rather than being a mask, by its name."""
    return path.name.lower().endswith(_LISTS)


def read_points(path: Path) -> dict[str, Vector]:
    """Points (3,) in LPS mm by name from a table `name x y z`, or from markups."""
    if is_markups(path):
        marks = read_marks(path)
        if not all(mark.point for mark in marks):
            raise DataError(f"{path}: holds a line, curve or box, not points; give a point list")
        return {name: mark.centre for name, mark in _named(path, marks).items()}
    return {name: np.array(numbers) for name, numbers in _rows(path, ("x", "y", "z")).items()}


def read_spheres(path: Path) -> dict[str, tuple[Vector, float]]:
    """Lesions as (centre (3,) in LPS mm, diameter in mm) by name, from `name x y z diameter_mm` or markups."""
    if is_markups(path):
        marks = _named(path, read_marks(path))
        return {name: (mark.centre, mark.diameter_mm or UNKNOWN_DIAMETER_MM) for name, mark in marks.items()}
    rows = _rows(path, ("x", "y", "z", "diameter_mm"))
    return {name: (np.array(n[:3]), _positive(path, name, n[3])) for name, n in rows.items()}


def without_diameter(path: Path) -> list[str]:
    """Names of the lesions in a file of markups that are given no diameter."""
    if not is_markups(path):
        return []
    return [name for name, mark in _named(path, read_marks(path)).items() if mark.diameter_mm is None]


def read_pixels(path: Path) -> dict[str, Vector]:
    """Pixels (2,) as (column, row) by name from a table `name column row`."""
    return {name: np.array(numbers) for name, numbers in _rows(path, ("column", "row")).items()}


def read_discs(path: Path) -> dict[str, tuple[Vector, float]]:
    """Lesions as (pixel (2,) as (column, row), diameter in mm) by name from a table `name column row diameter_mm`."""
    rows = _rows(path, ("column", "row", "diameter_mm"))
    return {name: (np.array(n[:2]), _positive(path, name, n[2])) for name, n in rows.items()}


def _named(path: Path, marks: Iterable[Mark]) -> dict[str, Mark]:
    """Marks by name; a shape without one is the lesion, or is numbered after it."""
    found: dict[str, Mark] = {}
    for mark in marks:
        shapes = sum(not known.point for known in found.values())
        name = mark.name or ("" if mark.point else f"{MASK_NAME}{shapes + 1 if shapes else ''}")
        if not name or name in found:
            what = f"name {name!r} is given twice" if name else "a point has no label"
            raise DataError(f"{path}: {what}; name each point in 3D Slicer")
        found[name] = mark
    return found


def _rows(path: Path, columns: tuple[str, ...]) -> dict[str, list[float]]:
    """Numbers by name from a table whose header is `name` and these columns."""
    try:
        table = read_table(path, ("name", *columns, *_SLICER_COLUMNS))
    except TableError as error:
        raise DataError(f"{path}: cannot be read as a tab-separated table ({error})") from error
    if not table.rows:
        raise DataError(f"{path}: the table is empty; give rows or leave the cell empty")
    exported = set(_SLICER_COLUMNS) <= set(table.header) and "name" not in table.header
    header = [_SLICER_COLUMNS.get(name, name) if exported else name for name in table.header]
    if missing := [c for c in ("name", *columns) if c not in header]:
        raise DataError(f"{path}: no column {', '.join(missing)}; the columns are name, {', '.join(columns)}")
    found: dict[str, list[float]] = {}
    for number, line in table.rows:
        cells = dict(zip(header, line, strict=False))
        name = cells.get("name", "")
        if not name or name in found:
            raise DataError(f"{path}, line {number}: name {name!r} is {'given twice' if name else 'empty'}")
        found[name] = [_number(path, number, column, cells.get(column)) for column in columns]
    return found


def _number(path: Path, line: int, column: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        hint = "; write a decimal point" if text and "," in text else ""
        raise DataError(f"{path}, line {line}, column {column}: {text!r} is no number{hint}")
    return value


def _positive(path: Path, name: str, diameter_mm: float) -> float:
    if diameter_mm <= 0:
        raise DataError(f"{path}, lesion {name}: diameter_mm must be positive, not {diameter_mm}")
    return diameter_mm
