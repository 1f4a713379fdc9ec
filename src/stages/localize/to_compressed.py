"""Into the compressed MR volume: landmarks carried by each method, placed by that volume's outline alone."""

from collections.abc import Mapping, Sequence

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import breast_to_lps, plate_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.to_compressed import SecondVolume, drawn_to_breast
from stages.engine.artefact import Fields
from stages.localize.record import CompressedRow, compressed_fields
from stages.localize.strays import Stray
from stages.localize.views import CaseViews
from stages.methods import METHODS
from stages.second_volume import view_in_second_volume


def predict_in_compressed(
    views: CaseViews,
    second: SecondVolume,
    landmarks: Mapping[str, Points],
    laterality: Laterality,
    strays: Mapping[str, Stray],
) -> Fields:
    """Rows of the landmarks (LPS), and by how much each method is shifted.

    The deformed breast is shifted to the second volume's outline; `rigid` is the best rigid fit of the undeformed
    skin to it.

    Args:
        views: of the case.
        second: what places results.
        landmarks: points (3,) of the undeformed volume by name, breast frame.
        strays: by name, what speaks against a mark; nothing is predicted for the refused ones.
    """
    refused = [name for name in landmarks if name in strays and strays[name].refused]
    landmarks = {name: point for name, point in landmarks.items() if name not in refused}
    view = view_in_second_volume(views.methods)
    rows: list[CompressedRow] = []
    points = np.array(list(landmarks.values())).reshape(-1, 3)
    shifts = _shifts(views, view, second)
    for name in refused:
        rows += missing_in_compressed([name], strays[name].message)
    for method in METHODS if landmarks else ():
        carried = _carried(views, view, second, method, points, shifts)
        if carried is None:
            rows += missing_in_compressed(list(landmarks), _trouble(views, view, method), (method,))
        else:
            rows += _rows(method, list(landmarks), breast_to_lps(carried, laterality), strays)
    moved = {method: _drawn(views, str(view), method) + shift for method, shift in shifts.items()}
    return compressed_fields(rows, view, {method: breast_to_lps(shift, laterality) for method, shift in moved.items()})


def _shifts(views: CaseViews, view: str | None, second: SecondVolume) -> dict[str, Points]:
    """By how much (3,) the second volume shifts what each method has deformed, breast frame, mm."""
    offered = views.methods[view] if view is not None else {}
    deformed = {method: way for method, way in offered.items() if method != "rigid"}
    return {method: second.shift(way, views.poses[str(view)].drawn_mm) for method, way in deformed.items()}


def _drawn(views: CaseViews, view: str, method: str) -> Points:
    """How far (3,) the pose has seen the breast drawn over the plates, breast frame, mm."""
    return plate_to_breast(views.poses[view].drawn_mm, views.methods[view][method].geometry.angle_deg)


def _carried(
    views: CaseViews,
    view: str | None,
    second: SecondVolume,
    method: str,
    points: Points,
    shifts: Mapping[str, Points],
) -> Points | None:
    """Points (N, 3) carried by a method, None where it has no result."""
    if view is None:
        return None
    if method == "rigid":
        return second.rigid(points)
    if method not in shifts:
        return None
    way, drawn = views.methods[view][method], views.poses[view].drawn_mm
    return np.asarray(drawn_to_breast(way, drawn, points) + shifts[method])


def _trouble(views: CaseViews, view: str | None, method: str) -> str:
    lost = view or view_in_second_volume({name for name, _ in views.troubles})
    return views.troubles.get((str(lost), method), "no view shows the compression")


def missing_in_compressed(names: Sequence[str], message: str, methods: Sequence[str] = METHODS) -> list[CompressedRow]:
    """Rows without numbers of landmarks by name."""
    return [CompressedRow(method, name, message=message) for method in methods for name in names]


def _rows(method: str, names: list[str], points: Points, strays: Mapping[str, Stray]) -> list[CompressedRow]:
    rows = []
    for name, point in zip(names, points, strict=True):
        x, y, z = map(float, point)
        rows.append(CompressedRow(method, name, x, y, z, strays[name].message if name in strays else ""))
    return rows
