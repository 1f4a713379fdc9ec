"""MR to mammogram: where each mammogram shows what is marked in the MR volume."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.lesions import LesionBody
from mammoreg.localization.to_mammogram import project_landmarks, project_lesion
from stages.engine.artefact import Fields
from stages.localize.record import AreaPrediction, MammogramRow, mammogram_fields
from stages.localize.strays import Stray
from stages.localize.views import CaseViews
from stages.methods import METHODS
from stages.pose.record import PoseRecord

UNSEEN = "outside the imaged part"


def predict_in_mammograms(
    views: CaseViews,
    bodies: Mapping[str, LesionBody],
    landmarks: Mapping[str, Points],
    strays: Mapping[str, Stray],
) -> Fields:
    """Rows `mammogram_rows` (pixels of the stored image), and the projected areas, canonical.

    Args:
        views: of the case.
        bodies: lesions of the MR volume by name, breast frame.
        landmarks: points (3,) of the MR volume by name, breast frame.
        strays: by name, what speaks against a mark; nothing is predicted for the refused ones.
    """
    refused = {name for name, stray in strays.items() if stray.refused}
    kept = {name: point for name, point in landmarks.items() if name not in refused}
    rows: list[MammogramRow] = []
    areas: list[AreaPrediction] = []
    for view in views.imaged:
        for method in METHODS:
            if (view, method) in views.troubles:
                rows += _missing(view, method, [*bodies, *landmarks], views.troubles[view, method])
                continue
            pose, way = views.poses[view], views.methods[view][method]
            rows += [
                MammogramRow(view, method, n, message=strays[n].message) for n in (*bodies, *landmarks) if n in refused
            ]
            for name, body in ((n, b) for n, b in bodies.items() if n not in refused):
                lesion = project_lesion(way, body)
                rows.append(_row(pose, method, name, lesion.centre, lesion.seen, strays))
                if lesion.area is not None:
                    areas.append(AreaPrediction(view, method, name, lesion.area))
            rows += _landmark_rows(pose, method, way, kept, strays)
    return mammogram_fields(rows, areas, list(bodies))


def missing_in_mammograms(views: CaseViews, names: list[str]) -> list[MammogramRow]:
    """Rows without numbers of lesions and landmarks by name, in views none of whose methods has a result."""
    pairs = [(view, method) for view in views.imaged for method in METHODS]
    return [row for pair in pairs for row in _missing(*pair, names, views.troubles[pair])]


def _missing(view: str, method: str, names: list[str], message: str) -> list[MammogramRow]:
    return [MammogramRow(view, method, name, message=message) for name in names]


def _landmark_rows(
    pose: PoseRecord, method: str, way: MethodView, landmarks: Mapping[str, Points], strays: Mapping[str, Stray]
) -> list[MammogramRow]:
    pixels, seen = project_landmarks(way, np.array(list(landmarks.values())).reshape(-1, 3))
    return [_row(pose, method, n, p, bool(s), strays) for n, p, s in zip(landmarks, pixels, seen, strict=True)]


def _row(
    pose: PoseRecord,
    method: str,
    name: str,
    pixel: NDArray[np.float64],
    seen: bool,
    strays: Mapping[str, Stray],
) -> MammogramRow:
    doubt = strays[name].message if name in strays else ""
    if not seen:
        return MammogramRow(pose.view, method, name, message="; ".join(filter(None, (UNSEEN, doubt))))
    column, row = map(float, pose.stored_pixels(pixel))
    return MammogramRow(pose.view, method, name, column, row, seen=True, message=doubt)
