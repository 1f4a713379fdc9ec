"""The lesion overview of a case (the paper's Figure 4)."""

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.localization.lesions import MaskLesion, MrLesion
from mammoreg.plots.overview import LesionCut, ViewLesions, VolumeLesions, lesion_overview
from mammoreg.plots.style import Png
from stages.annotations import mr_lesions, view_areas
from stages.figures.case import BEST_FIRST, PicturedCase, first_of
from stages.figures.images import mammogram, projection
from stages.localize.record import Predictions
from stages.methods import METHODS

_SPHERE_STEP_MM = 0.5


def overview(case: PicturedCase) -> Png | None:
    """Mammograms, projections and MR slices with true and predicted lesions; None without a mammogram."""
    segment, predictions = case.segment, case.predictions
    if segment is None or predictions is None or not case.imaged:
        return None
    method = first_of(BEST_FIRST, {name for view in case.imaged for name in case.methods.get(view, {})}) or METHODS[0]
    lesions = mr_lesions(case.inputs)
    centres = {name: lesion.centre for name, lesion in lesions.items()}
    found = [_cut(predictions, method, name, centres.get(name)) for name in case.lesions]
    cuts = [cut for cut in found if cut is not None]
    regions = {name: predictions.region(method, name) for name in case.mammogram_lesions}
    mr = VolumeLesions(
        segment.mr_lps,
        cuts or [LesionCut("", segment.nipple_lps)],
        {name: lesion_mask(lesion) for name, lesion in lesions.items()},
        {name: region for name, region in regions.items() if region is not None},
    )
    views = [_view_lesions(case, predictions, view, method) for view in case.imaged]
    return lesion_overview(views, mr, case.lesions, case.breast, method)


def _cut(predictions: Predictions, method: str, name: str, marked: Points | None) -> LesionCut | None:
    """Through the predicted place, with the beam where one view alone tells it; else through the marked lesion."""
    row = predictions.in_mr(method, name)
    if row is None:
        return None if marked is None else LesionCut(name, np.asarray(marked, dtype=float))
    views = row.views.split("+")
    curve = predictions.curve(method, name, views[0]) if len(views) == 1 else None
    return LesionCut(name, row.point, curve)


def _view_lesions(case: PicturedCase, predictions: Predictions, view: str, method: str) -> ViewLesions:
    pose, projected = case.imaged[view], case.projection(view)
    shown = projection(pose, projected, method) if projected and projected.shows(method) else None
    found = {name: predictions.area(view, method, name) for name in case.mr_lesions}
    predicted = {name: area for name, area in found.items() if area is not None}
    return ViewLesions(view, mammogram(pose), shown, view_areas(case.inputs, pose), predicted)


def lesion_mask(lesion: MrLesion) -> Volume:
    """A marked lesion as a mask on some grid, LPS."""
    if isinstance(lesion, MaskLesion):
        return lesion.mask
    half = 0.5 * lesion.diameter_mm + _SPHERE_STEP_MM
    steps = np.arange(-half, half + _SPHERE_STEP_MM, _SPHERE_STEP_MM)
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    inside = np.linalg.norm(grid, axis=-1) <= 0.5 * lesion.diameter_mm
    return Volume(inside, np.asarray(lesion.centre) + steps[0], np.full(3, _SPHERE_STEP_MM), "LPS")
