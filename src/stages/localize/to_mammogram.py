"""MR to mammogram: where each mammogram shows what is marked in the MR volume."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry.frames import Points
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.lesions import LesionBody
from mammoreg.localization.to_mammogram import project_landmarks, project_lesion
from stages.engine.artefact import Artefact, Fields
from stages.localize.views import CaseViews
from stages.marks import area_field, stored_pixels
from stages.methods import METHODS

Rows = list[dict[str, Any]]
UNSEEN = "outside the imaged part"


def predict_in_mammograms(
    views: CaseViews, bodies: Mapping[str, LesionBody], landmarks: Mapping[str, Points]
) -> Fields:
    """Rows `mammogram_rows` (pixels of the stored image), and the projected areas, canonical.

    Args:
        views: of the case.
        bodies: lesions of the MR volume by name, breast frame.
        landmarks: points (3,) of the MR volume by name, breast frame.
    """
    rows: Rows = []
    arrays, places = {}, {}
    for view in views.imaged:
        for method in METHODS:
            if (view, method) in views.troubles:
                rows += _missing(view, method, [*bodies, *landmarks], views.troubles[view, method])
                continue
            pose, way = views.poses[view], views.methods[view][method]
            for number, (name, body) in enumerate(bodies.items()):
                lesion = project_lesion(way, body)
                rows.append(_row(pose, method, name, lesion.centre, lesion.seen))
                if lesion.area is not None:
                    key = area_key(view, method, number)
                    arrays[key], places[key] = area_field(lesion.area, f"{name}, predicted by {method}")
            rows += _landmark_rows(pose, method, way, landmarks)
    values: dict[str, Any] = {"mammogram_rows": rows, "mammogram_area_places": places, "mr_lesion_names": list(bodies)}
    return Fields(arrays=arrays, values=values)


def missing_in_mammograms(views: CaseViews, names: list[str]) -> Rows:
    """Rows without numbers of lesions and landmarks by name, in views none of whose methods has a result."""
    pairs = [(view, method) for view in views.imaged for method in METHODS]
    return [row for pair in pairs for row in _missing(*pair, names, views.troubles[pair])]


def area_key(view: str, method: str, number: int) -> str:
    """Name of the array of a projected lesion, numbered as in `mr_lesion_names`."""
    return f"mammogram/{view}/{method}/lesion{number}"


def _landmark_rows(pose: Artefact, method: str, way: MethodView, landmarks: Mapping[str, Points]) -> Rows:
    pixels, seen = project_landmarks(way, np.array(list(landmarks.values())).reshape(-1, 3))
    return [_row(pose, method, n, p, bool(s)) for n, p, s in zip(landmarks, pixels, seen, strict=True)]


def _row(pose: Artefact, method: str, name: str, pixel: NDArray[np.float64], seen: bool) -> dict[str, Any]:
    column, row = stored_pixels(pose, pixel) if seen else (None, None)
    return _line(str(pose.view), method, name, column, row, seen, "" if seen else UNSEEN)


def _missing(view: str, method: str, names: list[str], message: str) -> Rows:
    return [_line(view, method, name, None, None, False, message) for name in names]


def _line(
    view: str, method: str, name: str, column: float | None, row: float | None, seen: bool, message: str
) -> dict[str, Any]:
    place = {"column": column, "row": row, "radius_mm": None, "seen": seen, "message": message}
    return {"view": view, "method": method, "name": name} | place
