"""What a run has left, as the last lines on the terminal: results, warnings, and where things are.

What failed stands above them: the last job of a run names it.
"""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

Row = dict[str, str]

_METHOD = "updated"
_MOST = 12
"""Lines of a list; the tables hold the rest."""


def summary(results: Path, targets: Sequence[str] = ()) -> str:
    """Lines that end a run.

    Args:
        results: the results folder.
        targets: what alone was asked for; none for the whole cohort.
    """
    tables = results / "tables"
    if targets or not (tables / "views.csv").exists():
        return "\n".join(_places(results, tables))
    trust = [f"  {_where(row)}: {row['trust']}" for row in _rows(tables / "views.csv") if _doubted(row)]
    lines = [f"results, method {_METHOD}:", *_shortened(list(_lesions(tables)), "no lesion was marked")]
    lines += ["warnings:", *_shortened(trust)] if trust else []
    return "\n".join([*lines, *_places(results, tables)])


def _lesions(tables: Path) -> Iterator[str]:
    """A line a lesion; landmarks, which the evaluation needs, are left to the tables."""
    landmarks = {(row["case"], row["landmark"]) for row in _rows(tables / "landmarks.csv")}
    for row in _rows(tables / "predictions_mammogram.csv"):
        if row["method"] == _METHOD and (row["case"], row["name"]) not in landmarks:
            place = f"column {row['column']}, row {row['row']}" if row["column"] else row["message"] or "not seen"
            yield f"  {_where(row)}: {row['name']} of the MR volume: {place}"
    for row in _rows(tables / "predictions_mr.csv"):
        if row["method"] == _METHOD:
            place = f"x {row['x']}, y {row['y']}, z {row['z']} mm (LPS)" if row["x"] else row["message"]
            note = f", depth not determined ({row['views']} alone)" if row["x"] and "+" not in row["views"] else ""
            yield f"  {row['case']} {row['views']}: {row['name']} of the mammogram: {place}{note}"


def _doubted(row: Row) -> bool:
    """Whether something speaks against a view; the grade `good` alone does not."""
    return row["method"] == _METHOD and row.get("trust", "") not in ("", "good")


def _where(row: Row) -> str:
    return f"{row['case']} {row['view']}" if row.get("view") else row["case"]


def _places(results: Path, tables: Path) -> Iterator[str]:
    found = {
        "report": results / "report.html",
        "tables": tables,
        "for 3D Slicer": next(iter(sorted(results.glob("*/export"))), results / "none"),
        "logs": results / "logs",
    }
    for name, path in found.items():
        if path.exists():
            shown = results / "<case>" / "export" if name == "for 3D Slicer" else path
            yield f"{name + ':':<15}{shown}"


def _shortened(lines: list[str], none: str = "") -> list[str]:
    more = len(lines) - _MOST
    shown = lines[:_MOST] + ([f"  and {more} more, see the tables"] if more > 0 else [])
    return shown or ([f"  {none}"] if none else [])


def _rows(path: Path) -> list[Row]:
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
