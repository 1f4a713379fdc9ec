"""Into the compressed MR volume: landmarks carried by each method, placed by that volume's outline alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mammoreg.geometry import Volume, lps_to_breast, plate_to_breast
from mammoreg.geometry.frames import Laterality, Points
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.to_compressed import fit_surface_to_outline, signed_distance
from stages.artefact import Fields
from stages.localizing.views import CaseViews
from stages.methods import METHODS


def predict_in_compressed(
    views: CaseViews, compressed: Volume, skin: Points, landmarks: Mapping[str, Points], laterality: Laterality
) -> Fields:
    """Rows `compressed_rows` (LPS).

    The deformed breast is shifted to the second volume's outline; `rigid` is the best rigid fit of the undeformed
    skin to it.

    Args:
        views: of the case.
        compressed: mask of the body between the plates, breast frame.
        skin: points (N, 3) on the undeformed skin, breast frame, mm.
        landmarks: points (3,) of the undeformed volume by name, breast frame.
    """
    view = next((v for v in ("3D", "CC", "MLO") if v in views.methods), None)
    rows: list[dict[str, Any]] = []
    points = np.array(list(landmarks.values())).reshape(-1, 3)
    if view is None or not landmarks:
        return Fields(values={"compressed_rows": rows})
    outline = signed_distance(compressed)
    for method in METHODS:
        if method == "rigid":
            carried = fit_surface_to_outline(skin, outline, rotate=True).forward(points)
        elif method in views.methods[view]:
            drawn = views.poses[view].value("drawn_mm") if view == "3D" else None
            carried = _carried(views.methods[view][method], drawn, outline, skin, points)
        else:
            carried = np.full(points.shape, np.nan)
        rows += _rows(method, list(landmarks), lps_to_breast(carried, laterality))
    return Fields(values={"compressed_rows": rows})


def _carried(way: MethodView, drawn_mm: list[float] | None, outline: Volume, skin: Points, points: Points) -> Points:
    """Points (N, 3) between the plates, breast frame, in the second volume's place.

    The mask places the result, from where the pose has seen the breast drawn to.
    """
    angle, drawn = way.geometry.angle_deg, np.array(drawn_mm or [0.0, 0.0, 0.0])
    carried = plate_to_breast(way.deformation.forward(points) + drawn, angle)
    surface = plate_to_breast(way.deformation.forward(skin) + drawn, angle)
    return fit_surface_to_outline(surface, outline, rotate=False).forward(carried)


def _rows(method: str, names: list[str], points: Points) -> list[dict[str, Any]]:
    return [
        {"method": method, "name": name, **dict(zip("xyz", map(float, point), strict=True))}
        for name, point in zip(names, points, strict=True)
    ]
