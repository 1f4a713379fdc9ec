"""Distances and overlaps of predicted and true places: Tables V and VI, and the landmarks."""

from collections.abc import Mapping

import numpy as np

from mammoreg.arrays import Points
from mammoreg.localization.lesions import LesionArea, MrLesion
from mammoreg.metrics.distances import detector_distance_mm, distance_to_curve_mm
from mammoreg.metrics.overlap import Overlap, overlap_of_areas, overlap_of_volumes
from stages.evaluate.record import Row
from stages.localize.record import MammogramRow, MrRow, Predictions
from stages.methods import METHODS
from stages.pose.record import PoseRecord
from stages.views import SECOND_VOLUME

_NO_OVERLAP: Row = {"overlap_percent": None, "dice": None, "size_ratio": None}


def lesion_rows_in_mammogram(
    predictions: Predictions, view: str, pose: PoseRecord | None, areas: Mapping[str, LesionArea], names: list[str]
) -> list[Row]:
    """Table V of one view; a lesion without prediction has empty numbers.

    Args:
        pose: of the view, None if it failed; then `areas` is empty.
        areas: true lesions by name, canonical pixels.
        names: lesions that MR volume and mammogram both mark.
    """
    rows = []
    for method in METHODS:
        for name in names:
            row: Row = {"view": view, "method": method, "name": name, "distance_mm": None, **_NO_OVERLAP}
            found = predictions.in_mammogram(view, method, name)
            if pose is not None and found is not None:
                row["distance_mm"] = _pixel_distance(pose, found, areas[name].centre)
                row |= _overlap(overlap_of_areas(predictions.area(view, method, name), areas[name]))
            rows.append(row)
    return rows


def landmark_rows_in_mammogram(
    predictions: Predictions, view: str, pose: PoseRecord | None, truth: Mapping[str, Points]
) -> list[Row]:
    """Distances of one view's landmarks; `truth` holds stored pixels (column, row) of those the MR volume marks too."""
    rows = []
    for method in METHODS:
        for name, pixel in truth.items():
            found = predictions.in_mammogram(view, method, name)
            distance = None
            if pose is not None and found is not None:
                distance = _pixel_distance(pose, found, pose.canonical_pixels(pixel))
            rows.append({"view": view, "method": method, "landmark": name, "distance_mm": distance})
    return rows


def lesion_rows_in_mr(
    predictions: Predictions, lesions: Mapping[str, MrLesion], views_of: Mapping[str, list[str]]
) -> list[Row]:
    """Table VI; a lesion that a method could not predict from all views that mark it has a row with empty numbers.

    Args:
        lesions: true lesions by name, LPS.
        views_of: the views that mark each of them; a lesion that none marks is left out.
    """
    rows = []
    for method in METHODS:
        for name, views in views_of.items():
            found = predictions.in_mr(method, name)
            if found is None or found.views != "+".join(views):
                rows.append(_mr_row("+".join(views), method, name))
            if found is not None:
                rows.append(_mr_row(found.views, method, name) | _mr_numbers(predictions, found, lesions[name]))
    return rows


def _mr_row(views: str, method: str, name: str) -> Row:
    empty = {"distance_mm": None, **_NO_OVERLAP, "distance_to_curve_mm": None}
    return {"views": views, "method": method, "name": name, **empty}


def _mr_numbers(predictions: Predictions, found: MrRow, lesion: MrLesion) -> Row:
    """Distance and overlap of a lesion; the distance to the curve where one view alone was used."""
    method, name, views = found.method, found.name, found.views
    numbers: Row = {"distance_mm": float(np.linalg.norm(found.point - lesion.centre))}
    numbers |= _overlap(overlap_of_volumes(predictions.region(method, name), lesion))
    if "+" not in views:
        numbers["distance_to_curve_mm"] = distance_to_curve_mm(lesion.centre, predictions.curve(method, name, views))
    return numbers


def landmark_rows_in_compressed(
    predictions: Predictions, before: Mapping[str, Points], truth: Mapping[str, Points]
) -> list[Row]:
    """Distances in the compressed volume, LPS points by name in both volumes.

    For comparison `before` (nothing moved) and `translation` (the best one, which knows the truth).
    """
    if not truth:
        return []
    start = np.array([before[name] for name in truth])
    goal = np.array(list(truth.values()))
    shift = (goal - start).mean(axis=0)
    references = {"before": start, "translation": start + shift}
    rows = [
        _landmark_3d(method, name, float(np.linalg.norm(point - true)))
        for method, points in references.items()
        for name, point, true in zip(truth, points, goal, strict=True)
    ]
    for method in METHODS:
        for name, true in truth.items():
            found = predictions.in_compressed(method, name)
            distance = None if found is None else float(np.linalg.norm(found.point - true))
            rows.append(_landmark_3d(method, name, distance))
    return rows


def _landmark_3d(method: str, name: str, distance_mm: float | None) -> Row:
    return {"view": SECOND_VOLUME, "method": method, "landmark": name, "distance_mm": distance_mm}


def _pixel_distance(pose: PoseRecord, found: MammogramRow, true: Points) -> float:
    predicted = pose.canonical_pixels(found.pixel)
    return float(detector_distance_mm(predicted, true, pose.geometry))


def _overlap(overlap: Overlap) -> Row:
    return {"overlap_percent": overlap.overlap_percent, "dice": overlap.dice, "size_ratio": overlap.size_ratio}
