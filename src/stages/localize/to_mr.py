"""Mammogram to MR: where in the undeformed MR volume a lesion marked in the mammograms lies."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, breast_to_lps
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.anatomy import clock_position, distance_to
from mammoreg.localization.grid import BreastGrid, BreastInView
from mammoreg.localization.lesions import LesionArea
from mammoreg.localization.to_mr import MrPrediction, locate_in_breast
from stages.engine.artefact import Fields
from stages.localize.record import MrRow, RegionPrediction, mr_fields
from stages.localize.strays import Stray
from stages.localize.views import CaseViews
from stages.methods import METHODS


@dataclass(frozen=True)
class UndeformedBreast:
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
    views: CaseViews,
    anatomy: UndeformedBreast,
    names_of: Mapping[str, list[str]],
    areas: Mapping[str, Mapping[str, LesionArea]],
    strays: Mapping[str, Mapping[str, Stray]],
) -> Fields:
    """Rows `mr_rows` (LPS), and per lesion and method the region and the curves.

    Args:
        views: of the case.
        anatomy: of the undeformed breast.
        names_of: lesions that each view marks, views whose pose failed too.
        areas: lesions by view and name, canonical pixels, of the other views.
        strays: by view and name, what speaks against a lesion's mark; a refused one is not used.
    """
    rows: list[MrRow] = []
    regions: list[RegionPrediction] = []
    grid = BreastGrid(anatomy.breast)
    names = list(dict.fromkeys(name for marked in names_of.values() for name in marked))
    for method in METHODS if names else ():
        offered = {view: m[method] for view, m in views.methods.items() if view in areas and method in m}
        seen = {view: BreastInView(way, grid) for view, way in offered.items()}
        for name in names:
            shown = [view for view in names_of if name in names_of[view]]
            doubts = {view: strays[view][name] for view in shown if name in strays.get(view, {})}
            usable = {
                view: areas[view][name]
                for view in shown
                if view in seen and not (view in doubts and doubts[view].refused)
            }
            lost = list(dict.fromkeys(views.troubles.get((v, method), "") for v in shown if v not in seen))
            lost += [doubt.message for doubt in doubts.values()]
            if not usable:
                rows.append(MrRow("+".join(shown), method, name, message="; ".join(lost)))
                continue
            found = locate_in_breast(seen, usable)
            rows.append(_row(method, name, found, anatomy, lost))
            regions.append(_region(method, name, found, anatomy.laterality))
    return mr_fields(rows, regions, names)


def missing_in_mr(names_of: Mapping[str, list[str]], message: str) -> list[MrRow]:
    """Rows without numbers of the lesions that views mark, given by view."""
    names = dict.fromkeys(name for marked in names_of.values() for name in marked)
    shown = {name: "+".join(view for view in names_of if name in names_of[view]) for name in names}
    return [MrRow(shown[name], method, name, message=message) for method in METHODS for name in names]


def _row(method: str, name: str, found: MrPrediction, anatomy: UndeformedBreast, lost: list[str]) -> MrRow:
    point = found.point
    x, y, z = breast_to_lps(point, anatomy.laterality).tolist()
    return MrRow(
        "+".join(found.curves),
        method,
        name,
        x=x,
        y=y,
        z=z,
        beam_gap_mm=found.beam_gap_mm,
        nipple_distance_mm=float(np.linalg.norm(point - anatomy.nipple)),
        clock=clock_position(point, anatomy.nipple, anatomy.laterality),
        skin_depth_mm=distance_to(point, anatomy.skin),
        chest_wall_depth_mm=distance_to(point, anatomy.chest_wall),
        message="; ".join(text for text in (found.message, *lost) if text),
    )


def _region(method: str, name: str, found: MrPrediction, laterality: Laterality) -> RegionPrediction:
    curves = {view: breast_to_lps(curve, laterality) for view, curve in found.curves.items()}
    region = found.region
    if region is not None:
        region = region.with_data(region.data.astype(np.uint8)).to_lps(laterality)
    return RegionPrediction(method, name, curves, region)
