"""Markups of 3D Slicer, `.mrk.json` and `.fcsv`, in the frame that they declare."""

import csv
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError

ENDINGS = (".json", ".fcsv")
UNKNOWN_DIAMETER_MM = 10.0
"""Taken for a lesion that is marked by a point without a diameter; the example of the tables' documentation."""

Vector = NDArray[np.float64]

_TO_LPS = {"LPS": (1.0, 1.0, 1.0), "RAS": (-1.0, -1.0, 1.0)}
_NUMBERED = {"0": "RAS", "1": "LPS", "2": "IJK"}
_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 0.001}
_POINT_TYPES = ("FIDUCIAL", "POINTLIST")
_DIAMETER = re.compile(r"^\s*(?:[dø⌀]\s*=?\s*)?(\d+(?:\.\d+)?)\s*(?:mm)?\s*$", re.IGNORECASE)
_WHERE = "say in which frame its coordinates are: LPS or RAS"


@dataclass(frozen=True)
class Mark:
    """A point or shape.

    Attributes:
        name: of the point or shape; empty where it has none.
        centre: (3,), LPS mm.
        diameter_mm: None where nothing tells.
        point: whether it is a point, not a shape.
    """

    name: str
    centre: Vector
    diameter_mm: float | None
    point: bool = True


def is_markups(path: Path) -> bool:
    """Whether a file is taken for markups of 3D Slicer, by its name."""
    return path.name.lower().endswith(ENDINGS)


def read_marks(path: Path) -> list[Mark]:
    """Points and shapes of a markups file, LPS mm.

    A point's diameter is the number that its description holds. A line's is its length, a closed curve's the largest
    distance of two of its points, a box's the geometric mean of its sides; their centres are the middle of the line,
    the mean along the curve, and the box's.

    Raises:
        DataError: the file is unreadable, marks nothing, or does not say in which frame.
    """
    marks = list(_fcsv_marks(path) if path.name.lower().endswith(".fcsv") else _json_marks(path))
    if not marks:
        raise DataError(f"{path}: marks nothing; place the points in 3D Slicer or leave the cell empty")
    return marks


def _fcsv_marks(path: Path) -> Iterator[Mark]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read as 3D Slicer's .fcsv; save the markups again") from error
    head = dict(line[1:].split("=", 1) for line in lines if line.startswith("#") and "=" in line)
    told = {key.strip().lower(): value.strip() for key, value in head.items()}
    to_lps = _signs(path, told.get("coordinatesystem"))
    columns = [name.strip() for name in told.get("columns", "").split(",")]
    if missing := [name for name in ("x", "y", "z", "label") if name not in columns]:
        raise DataError(f"{path}: its header names no column {', '.join(missing)}; save the markups again")
    for number, line in enumerate(lines, start=1):
        if line.strip() and not line.startswith("#"):
            cells = dict(zip(columns, _cells(line), strict=False))
            place = _vector(f"{path}, line {number}", [cells.get(axis) for axis in "xyz"])
            yield Mark(cells.get("label", "").strip(), place * to_lps, _diameter(cells.get("desc")))


def _cells(line: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except csv.Error:
        return []


def _json_marks(path: Path) -> Iterator[Mark]:
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        for markup in content["markups"]:
            yield from _marks_of(path, dict(markup))
    except DataError:
        raise
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DataError(f"{path}: is no markups file of 3D Slicer; save the markups again as .mrk.json") from error


def _marks_of(path: Path, markup: Mapping[str, Any]) -> Iterator[Mark]:
    """Marks of one node of a `.mrk.json`."""
    scale = _signs(path, markup.get("coordinateSystem")) * _unit_mm(path, markup.get("coordinateUnits"))
    kind = str(markup.get("type", "Fiducial")).upper()
    name = str(markup.get("name") or "").strip()
    if kind == "ROI":
        sides = np.abs(_vector(f"{path}, size", markup.get("size")) * scale)
        yield Mark(
            name, _vector(f"{path}, center", markup.get("center")) * scale, float(np.prod(sides)) ** (1 / 3), False
        )
        return
    points = [dict(p) for p in markup.get("controlPoints") or [] if p.get("positionStatus", "defined") == "defined"]
    labels = [str(p.get("label") or "").strip() for p in points]
    places = [_vector(f"{path}, {n}", p.get("position")) * scale for n, p in zip(labels, points, strict=True)]
    if kind in _POINT_TYPES:
        for label, place, point in zip(labels, places, points, strict=True):
            yield Mark(label, place, _diameter(point.get("description")))
    elif places:
        yield _shape(path, kind, name, np.array(places))


def _shape(path: Path, kind: str, name: str, places: Vector) -> Mark:
    """What a line of two points, or a closed curve, marks."""
    if not (kind == "LINE" and len(places) == 2) and not (kind == "CLOSEDCURVE" and len(places) > 2):
        raise DataError(
            f"{path}: a markup of type {kind.lower()} with {len(places)} points marks neither points nor a lesion; "
            "use a point list, a line, a closed curve or a box"
        )
    ends = np.roll(places, -1, axis=0)
    lengths = np.linalg.norm(ends - places, axis=1)
    if not lengths.sum() > 0.0:
        raise DataError(f"{path}: all points of a {kind.lower()} lie at one place; draw it again")
    centre = (lengths[:, None] * 0.5 * (ends + places)).sum(axis=0) / lengths.sum()
    largest = np.linalg.norm(places[:, None] - places[None], axis=2).max()
    return Mark(name, centre, float(largest), point=False)


def _signs(path: Path, declared: Any) -> Vector:
    """Factors (3,) that take coordinates of the declared frame to LPS."""
    text = "" if declared is None else str(declared).strip().upper()
    frame = _NUMBERED.get(text, text)
    if frame not in _TO_LPS:
        what = f"declares the coordinate system {text!r}" if text else "declares no coordinate system"
        raise DataError(f"{path}: {what}; {_WHERE}")
    return np.array(_TO_LPS[frame])


def _unit_mm(path: Path, declared: Any) -> float:
    unit = declared[0] if isinstance(declared, list) and declared else declared
    if unit in (None, ""):
        return 1.0
    if str(unit) not in _MM:
        raise DataError(f"{path}: gives coordinates in {unit!r}; known are {', '.join(_MM)}")
    return _MM[str(unit)]


def _vector(where: str, values: Any) -> Vector:
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        found = np.full(3, np.nan)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise DataError(f"{where}: {values!r} are no three numbers")
    return found


def _diameter(text: Any) -> float | None:
    """The diameter that a point's description gives, such as `12` or `12 mm`."""
    found = _DIAMETER.match(str(text or ""))
    value = float(found.group(1)) if found else 0.0
    return value if value > 0.0 else None
