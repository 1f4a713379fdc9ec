"""Predictions of one mesh against the truth and against those of the finest mesh."""

from collections.abc import Mapping

import numpy as np

from mammoreg.metrics.distances import breast_scale_mm
from stages.engine.artefact import Artefact
from stages.evaluate.record import EvaluateRecord
from stages.localize.record import Predictions
from stages.methods import METHODS
from stages.pose.record import PoseRecord
from stages.views import SECOND_VOLUME

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
    errors: dict[str, list[float]] = {}
    for method, distance in EvaluateRecord(one["evaluate"]).distances(view):
        errors.setdefault(method, []).append(distance)
    found = {}
    for method in METHODS:
        places = here.get(method, {})
        gaps = [float(np.linalg.norm(p - there[method][n])) for n, p in places.items() if n in there.get(method, {})]
        if places:
            found[method] = (_mean(errors.get(method, [])), _mean(gaps))
    return found


def _places(view: str, opened: Opened) -> dict[str, dict[str, np.ndarray]]:
    """Predicted places by method and name, mm; in a mammogram scaled to the middle of the plates."""
    predictions, found = Predictions(opened["localize"]), dict[str, dict[str, np.ndarray]]()
    if view == SECOND_VOLUME:
        for placed in (row for row in predictions.compressed_rows if row.x is not None):
            found.setdefault(placed.method, {})[placed.name] = placed.point
    elif opened["pose"].ok:
        pose = PoseRecord(opened["pose"])
        for shown in (row for row in predictions.mammogram_rows if row.view == view and row.seen):
            place = pose.canonical_pixels(shown.pixel) * breast_scale_mm(pose.geometry)
            found.setdefault(shown.method, {})[shown.name] = np.asarray(place)
    return found


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None
