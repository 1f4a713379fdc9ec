"""Into the compressed MR volume: landmarks carried by each method, placed by that volume's outline alone."""

from collections.abc import Mapping, Sequence

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import breast_to_lps
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.to_compressed import SecondVolume
from stages.engine.artefact import Fields
from stages.localize.record import CompressedRow, compressed_fields
from stages.localize.views import CaseViews
from stages.methods import METHODS
from stages.second_volume import view_in_second_volume


def predict_in_compressed(
    views: CaseViews, second: SecondVolume, landmarks: Mapping[str, Points], laterality: Laterality
) -> Fields:
    """Rows `compressed_rows` (LPS).

    The deformed breast is shifted to the second volume's outline; `rigid` is the best rigid fit of the undeformed
    skin to it.

    Args:
        views: of the case.
        second: what places results.
        landmarks: points (3,) of the undeformed volume by name, breast frame.
    """
    view = view_in_second_volume(views.methods)
    rows: list[CompressedRow] = []
    points = np.array(list(landmarks.values())).reshape(-1, 3)
    if not landmarks:
        return compressed_fields(rows)
    for method in METHODS:
        carried = _carried(views, view, second, method, points)
        if carried is None:
            rows += missing_in_compressed(list(landmarks), _trouble(views, view, method), (method,))
        else:
            rows += _rows(method, list(landmarks), breast_to_lps(carried, laterality))
    return compressed_fields(rows)


def _carried(views: CaseViews, view: str | None, second: SecondVolume, method: str, points: Points) -> Points | None:
    """Points (N, 3) carried by a method, None where it has no result."""
    if view is None:
        return None
    if method == "rigid":
        return second.rigid(points)
    if method not in views.methods[view]:
        return None
    return second.place(views.methods[view][method], views.poses[view].drawn_mm, points)


def _trouble(views: CaseViews, view: str | None, method: str) -> str:
    lost = view or view_in_second_volume({name for name, _ in views.troubles})
    return views.troubles.get((str(lost), method), "no view shows the compression")


def missing_in_compressed(names: Sequence[str], message: str, methods: Sequence[str] = METHODS) -> list[CompressedRow]:
    """Rows without numbers of landmarks by name."""
    return [CompressedRow(method, name, message=message) for method in methods for name in names]


def _rows(method: str, names: list[str], points: Points) -> list[CompressedRow]:
    return [CompressedRow(method, name, *point.tolist()) for name, point in zip(names, points, strict=True)]
