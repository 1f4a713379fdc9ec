"""Predictions of one mesh against the truth and against those of the finest mesh."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mammoreg.metrics.distances import breast_scale_mm
from stages.engine.artefact import Artefact
from stages.marks import canonical_pixels
from stages.methods import METHODS, view_geometry

Opened = Mapping[str, Artefact]
Result = tuple[float | None, float | None]


def view_results(view: str, one: Opened, finest: Opened) -> dict[str, Result]:
    """Error and discretisation in mm of each method that predicted anything in a view.

    Args:
        view: CC, MLO, or 3D for landmarks in a second volume.
        one: artefacts `localize`, `evaluate` and the view's `pose` of a mesh.
        finest: those of the finest mesh.

    Returns:
        Mean distance to the truth over all that has one, and mean distance to the finest mesh's predictions; each
        None where there is nothing to compare.
    """
    if not one["pose"].ok:
        return {}
    here, there = (_places(view, opened) for opened in (one, finest))
    errors = _errors(view, one["evaluate"])
    found = {}
    for method in METHODS:
        places = here.get(method, {})
        gaps = [float(np.linalg.norm(p - there[method][n])) for n, p in places.items() if n in there.get(method, {})]
        if places:
            found[method] = (_mean(errors.get(method, [])), _mean(gaps))
    return found


def _places(view: str, opened: Opened) -> dict[str, dict[str, np.ndarray]]:
    """Predicted places by method and name, mm; in a mammogram scaled to the middle of the plates."""
    localize, pose = opened["localize"], opened["pose"]
    rows: list[dict[str, Any]] = localize.value(name) if localize.has(name := _rows_name(view)) else []
    found: dict[str, dict[str, np.ndarray]] = {}
    for row in rows:
        place = _place(view, row, pose)
        if place is not None:
            found.setdefault(row["method"], {})[row["name"]] = place
    return found


def _rows_name(view: str) -> str:
    return "compressed_rows" if view == "3D" else "mammogram_rows"


def _place(view: str, row: Mapping[str, Any], pose: Artefact) -> np.ndarray | None:
    if view == "3D":
        return None if row["x"] is None else np.array([row["x"], row["y"], row["z"]])
    if row["view"] != view or not row["seen"] or not pose.ok:
        return None
    pixel = canonical_pixels(pose, np.array([row["column"], row["row"]]))
    return np.asarray(pixel * breast_scale_mm(view_geometry(pose)))


def _errors(view: str, evaluate: Artefact) -> dict[str, list[float]]:
    """Distances to the truth by method: landmarks and lesions alike."""
    found: dict[str, list[float]] = {}
    for name in ("landmark_rows", "table_5_rows"):
        for row in evaluate.value(name) if evaluate.has(name) else []:
            if row["view"] == view and row["distance_mm"] is not None:
                found.setdefault(row["method"], []).append(float(row["distance_mm"]))
    return found


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None
