"""Landmarks of a case as pictures: where they were predicted and where they are."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.plots.detector import pixels_to_mm
from mammoreg.plots.landmarks import ViewLandmarks, landmarks_in_mammograms, landmarks_in_volume
from mammoreg.plots.style import Png
from stages.annotations import mr_landmarks, view_landmarks
from stages.figures.case import PicturedCase
from stages.figures.images import mammogram
from stages.localize.record import Predictions
from stages.pose.record import PoseRecord

_SHOWN = ("rigid", "plate", "updated")


def in_mammograms(case: PicturedCase) -> Png | None:
    """Per view the landmarks that MR volume and mammogram both mark."""
    before, predictions = mr_landmarks(case.inputs), case.predictions
    if predictions is None:
        return None
    views = []
    for view, pose in case.imaged.items():
        truth = {n: p for n, p in view_landmarks(case.inputs, view).items() if n in before}
        if truth:
            offered = [method for method in _SHOWN if method in case.methods.get(view, {})]
            predicted = {method: _predicted(predictions, pose, method, list(truth)) for method in offered}
            true = _mm(pose, pose.canonical_pixels(np.array(list(truth.values()))))
            views.append(ViewLandmarks(view, mammogram(pose), true, predicted))
    return landmarks_in_mammograms(views, case.breast) if any(v.predicted for v in views) else None


def _predicted(predictions: Predictions, pose: PoseRecord, method: str, names: list[str]) -> NDArray[np.float64]:
    rows = [predictions.in_mammogram(pose.view, method, name) for name in names]
    pixels = np.array([[np.nan] * 2 if row is None else row.pixel for row in rows], dtype=float)
    return _mm(pose, pose.canonical_pixels(pixels))


def _mm(pose: PoseRecord, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    return pixels_to_mm(pixels, pose.geometry.rows, pose.geometry.pixel_mm)


def in_second_volume(case: PicturedCase) -> Png | None:
    """Landmarks carried into the second MR volume, over the silhouettes of its body."""
    segment, truth = case.segment, mr_landmarks(case.inputs, "mr_compressed_landmarks")
    predictions, mask = case.predictions, segment.compressed_mask_lps if segment else None
    if mask is None or predictions is None or not truth:
        return None
    predicted = {}
    for method in _SHOWN:
        rows = [predictions.in_compressed(method, name) for name in truth]
        if any(row is not None for row in rows):
            places = [[np.nan] * 3 if row is None else row.point for row in rows]
            predicted[method] = np.array(places, dtype=float)
    true = np.array(list(truth.values()))
    return landmarks_in_volume(mask, true, predicted, case.breast) if predicted else None
