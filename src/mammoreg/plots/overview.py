"""The paper's Figure 4: lesions in the mammogram, in the projection of the deformed MR volume and in the MR volume."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.localization.lesions import LesionArea
from mammoreg.plots.detector import DetectorImage, draw_area, line_key, show_detector_image
from mammoreg.plots.slices import Plane, SliceOverlay, show_slice
from mammoreg.plots.style import (
    PREDICTED_COLOUR,
    TRUE_COLOUR,
    Png,
    add_notice,
    new_figure,
    side_name,
    to_png,
)


@dataclass(frozen=True)
class ViewLesions:
    """One view's mammogram, the projection beside it, and lesions as areas in the mammogram's canonical pixels."""

    view: str
    mammogram: DetectorImage
    projection: DetectorImage | None
    true: Sequence[LesionArea] = ()
    predicted: Sequence[LesionArea] = ()


@dataclass(frozen=True)
class VolumeLesions:
    """The undeformed MR volume in LPS, the point (3,) through which it is cut, and lesions as masks on any grid."""

    volume: Volume
    through: NDArray[np.float64]
    true: Sequence[Volume] = field(default_factory=tuple)
    predicted: Sequence[Volume] = field(default_factory=tuple)


def lesion_overview(views: Sequence[ViewLesions], mr: VolumeLesions, laterality: str, method: str) -> Png:
    """Per view mammogram and MR projection, and slices of the MR volume; true lesions red, predicted ones blue."""
    planes: tuple[Plane, ...] = ("axial", "sagittal") if len(views) > 1 else ("axial",)
    with new_figure(10.5, 0.4 + 4.1 * len(views)) as figure:
        grid = figure.add_gridspec(len(views), 3, width_ratios=[1, 1, 1.15])
        for row, view in enumerate(views):
            _draw_view(figure, grid[row, 0], grid[row, 1], view, laterality)
        for row, plane in enumerate(planes):
            axes = figure.add_subplot(grid[row, 2])
            overlays = [SliceOverlay(mask, TRUE_COLOUR) for mask in mr.true]
            overlays += [SliceOverlay(mask, PREDICTED_COLOUR) for mask in mr.predicted]
            show_slice(axes, mr.volume, plane, mr.through, overlays, f"{laterality} MR, {plane}")
        keys = [line_key(TRUE_COLOUR, "lesion as marked"), line_key(PREDICTED_COLOUR, f"predicted ({method})")]
        figure.legend(handles=keys, loc="outside lower center", ncols=2)
        add_notice(figure, side_name(laterality), "Lesion localisation")
        return to_png(figure)


def _draw_view(figure: Figure, left: SubplotSpec, right: SubplotSpec, view: ViewLesions, laterality: str) -> None:
    """Mammogram and projection of one view, both with the lesions."""
    pictures = [("mammogram", left, view.mammogram), ("MR projection", right, view.projection)]
    for name, place, image in pictures:
        if image is None:
            continue
        axes = figure.add_subplot(place)
        show_detector_image(axes, image, laterality, view.view, f"{view.view}: {name}")
        for areas, colour in ((view.true, TRUE_COLOUR), (view.predicted, PREDICTED_COLOUR)):
            for area in areas:
                draw_area(axes, area, view.mammogram, colour)
