"""Mammogram to MR: where in the undeformed MR volume a lesion marked in the mammograms lies."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mammoreg.geometry import Volume, breast_to_lps
from mammoreg.geometry.frames import Laterality, Points
from mammoreg.localization.anatomy import clock_position, distance_to
from mammoreg.localization.grid import BreastGrid, BreastInView
from mammoreg.localization.lesions import LesionArea
from mammoreg.localization.to_mr import MrPrediction, locate_in_breast
from stages.engine.artefact import Array, Fields, VolumeField
from stages.localize.views import CaseViews
from stages.methods import METHODS

_WIDEST_GAP_MM = 10.0


@dataclass(frozen=True)
class Anatomy:
    """The undeformed breast in the breast frame.

    Attributes:
        breast: its mask.
        nipple: position (3,), mm.
        skin, chest_wall: points (N, 3) on the skin and on the chest wall, mm.
    """

    laterality: Laterality
    breast: Volume
    nipple: Points
    skin: Points
    chest_wall: Points


def predict_in_mr(
    views: CaseViews, anatomy: Anatomy, names_of: Mapping[str, list[str]], areas: Mapping[str, Mapping[str, LesionArea]]
) -> Fields:
    """Rows `mr_rows` (LPS), and per lesion and method the region and the curves.

    Args:
        views: of the case.
        anatomy: of the undeformed breast.
        names_of: lesions that each view marks, views whose pose failed too.
        areas: lesions by view and name, canonical pixels, of the other views.
    """
    rows: list[dict[str, Any]] = []
    arrays: dict[str, Array] = {}
    volumes: dict[str, VolumeField] = {}
    grid = BreastGrid(anatomy.breast)
    names = list(dict.fromkeys(name for marked in names_of.values() for name in marked))
    for method in METHODS if names else ():
        offered = {view: m[method] for view, m in views.methods.items() if view in areas and method in m}
        seen = {view: BreastInView(way, grid) for view, way in offered.items()}
        for number, name in enumerate(names):
            shown = [view for view in names_of if name in names_of[view]]
            usable = {view: areas[view][name] for view in shown if view in seen}
            lost = list(dict.fromkeys(views.troubles.get((v, method), "") for v in shown if v not in seen))
            if not usable:
                rows.append(_line(method, name, "+".join(shown), "; ".join(lost)))
                continue
            found = locate_in_breast(seen, usable)
            rows.append(_row(method, name, found, anatomy, lost))
            key = mr_key(method, number)
            arrays |= _curves(key, found, anatomy.laterality)
            volumes |= _region(key, found, anatomy.laterality)
    return Fields(arrays=arrays, volumes=volumes, values={"mr_rows": rows, "mammogram_lesion_names": names})


def missing_in_mr(names_of: Mapping[str, list[str]], message: str) -> list[dict[str, Any]]:
    """Rows without numbers of the lesions that views mark, given by view."""
    names = dict.fromkeys(name for marked in names_of.values() for name in marked)
    shown = {name: "+".join(view for view in names_of if name in names_of[view]) for name in names}
    return [_line(method, name, shown[name], message) for method in METHODS for name in names]


def mr_key(method: str, number: int) -> str:
    """Group of a lesion's region and curves, numbered as in `mammogram_lesion_names`."""
    return f"mr/{method}/lesion{number}"


def _row(method: str, name: str, found: MrPrediction, anatomy: Anatomy, lost: list[str]) -> dict[str, Any]:
    point = found.point
    message = "; ".join(text for text in (found.message, *lost) if text)
    row = _line(method, name, "+".join(found.curves), message)
    row |= dict(zip("xyz", breast_to_lps(point, anatomy.laterality).tolist(), strict=True))
    return row | {
        "beam_gap_mm": found.beam_gap_mm,
        "nipple_distance_mm": float(np.linalg.norm(point - anatomy.nipple)),
        "clock": clock_position(point, anatomy.nipple, anatomy.laterality),
        "skin_depth_mm": distance_to(point, anatomy.skin),
        "chest_wall_depth_mm": distance_to(point, anatomy.chest_wall),
    }


def _line(method: str, name: str, views: str, message: str) -> dict[str, Any]:
    numbers = ("x", "y", "z", "radius_mm", "beam_gap_mm", "nipple_distance_mm")
    depths = ("skin_depth_mm", "chest_wall_depth_mm")
    row: dict[str, Any] = {"views": views, "method": method, "name": name}
    return row | dict.fromkeys(numbers) | {"clock": ""} | dict.fromkeys(depths) | {"message": message}


def _curves(key: str, found: MrPrediction, laterality: Laterality) -> dict[str, Array]:
    return {
        f"{key}/curve_{view}": Array(breast_to_lps(curve, laterality), "mm", f"beam of {view} in the undeformed breast")
        for view, curve in found.curves.items()
    }


def _region(key: str, found: MrPrediction, laterality: Laterality) -> dict[str, VolumeField]:
    if found.region is None:
        return {}
    region = found.region.with_data(found.region.data.astype(np.uint8)).to_lps(laterality)
    return {f"{key}/region": VolumeField(region, "1", "predicted lesion in the undeformed breast")}
