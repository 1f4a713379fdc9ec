"""The lesion overview of a case (the paper's Figure 4)."""

import numpy as np

from mammoreg.geometry import Volume
from mammoreg.localization.lesions import MaskLesion, MrLesion
from mammoreg.plots.overview import ViewLesions, VolumeLesions, lesion_overview
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
    found = [predictions.region(method, name) for name in case.mammogram_lesions]
    true, predicted = [lesion_mask(lesion) for lesion in lesions.values()], [region for region in found if region]
    points = [row for name in case.mammogram_lesions if (row := predictions.in_mr(method, name)) is not None]
    centres = [*(lesion.centre for lesion in lesions.values()), *(row.point for row in points)]
    through = np.asarray(centres[0] if centres else segment.nipple_lps, dtype=float)
    views = [_view_lesions(case, predictions, view, method) for view in case.imaged]
    return lesion_overview(views, VolumeLesions(segment.mr_lps, through, true, predicted), case.laterality, method)


def _view_lesions(case: PicturedCase, predictions: Predictions, view: str, method: str) -> ViewLesions:
    pose, projected = case.imaged[view], case.projection(view)
    shown = projection(pose, projected, method) if projected and projected.shows(method) else None
    found = [predictions.area(view, method, name) for name in case.mr_lesions]
    true = list(view_areas(case.inputs, pose).values())
    return ViewLesions(view, mammogram(pose), shown, true, [area for area in found if area is not None])


def lesion_mask(lesion: MrLesion) -> Volume:
    """A marked lesion as a mask on some grid, LPS."""
    if isinstance(lesion, MaskLesion):
        return lesion.mask
    half = 0.5 * lesion.diameter_mm + _SPHERE_STEP_MM
    steps = np.arange(-half, half + _SPHERE_STEP_MM, _SPHERE_STEP_MM)
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    inside = np.linalg.norm(grid, axis=-1) <= 0.5 * lesion.diameter_mm
    return Volume(inside, np.asarray(lesion.centre) + steps[0], np.full(3, _SPHERE_STEP_MM), "LPS")
