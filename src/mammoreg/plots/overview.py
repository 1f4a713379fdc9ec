"""The paper's Figure 4: lesions in the mammogram, in the projection of the deformed MR volume and in the MR volume."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.localization.lesions import LesionArea
from mammoreg.plots.detector import DetectorImage, draw_area, line_key, show_detector_image
from mammoreg.plots.slices import Plane, SliceOverlay, draw_curve, draw_point, off_slice_mm, shadow, show_slice
from mammoreg.plots.style import (
    LESION_COLOURS,
    PREDICTED_COLOUR,
    TRUE_COLOUR,
    PicturedBreast,
    Png,
    add_corner_label,
    add_notice,
    new_figure,
    to_png,
    whole_mm,
)

_PLANES: tuple[Plane, ...] = ("axial", "sagittal")
_MARKED, _PREDICTED, _BESIDE = "-", "--", (0, (1.0, 2.2))


@dataclass(frozen=True)
class ViewLesions:
    """One view's mammogram, the projection beside it, and lesions by name, in the mammogram's canonical pixels."""

    view: str
    mammogram: DetectorImage
    projection: DetectorImage | None
    true: Mapping[str, LesionArea] = field(default_factory=dict)
    predicted: Mapping[str, LesionArea] = field(default_factory=dict)


@dataclass(frozen=True)
class LesionCut:
    """Where the MR volume is cut for a lesion.

    Attributes:
        name: of the lesion; empty where none is marked.
        through: point (3,) on both slices, LPS mm: the predicted place where there is one.
        curve: the beam of the only view (N, 3), LPS mm, along which the lesion's depth is not determined.
    """

    name: str
    through: NDArray[np.float64]
    curve: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class VolumeLesions:
    """The undeformed MR volume in LPS, one cut a lesion, and lesions by name as masks on any grid."""

    volume: Volume
    cuts: Sequence[LesionCut]
    true: Mapping[str, Volume] = field(default_factory=dict)
    predicted: Mapping[str, Volume] = field(default_factory=dict)


@dataclass(frozen=True)
class LesionColours:
    """Colours of the lesions: one lesion is told by true and predicted, several each by one of its own."""

    names: Sequence[str]

    def true(self, name: str) -> str:
        """Colour of the lesion as marked."""
        return TRUE_COLOUR if len(self.names) < 2 else self._own(name)

    def predicted(self, name: str) -> str:
        """Colour of the lesion as predicted."""
        return PREDICTED_COLOUR if len(self.names) < 2 else self._own(name)

    def _own(self, name: str) -> str:
        return LESION_COLOURS[self.names.index(name) % len(LESION_COLOURS)]

    def keys(self, method: str, with_curve: bool) -> Iterator[Line2D]:
        """Lines for the legend."""
        neutral = "#777777"
        if len(self.names) > 1:
            yield from (line_key(self._own(name), name) for name in self.names)
        marked, predicted = (neutral,) * 2 if len(self.names) > 1 else (TRUE_COLOUR, PREDICTED_COLOUR)
        yield line_key(marked, "as marked")
        yield line_key(predicted, f"predicted ({method})", _PREDICTED)
        if with_curve:
            yield line_key(predicted, "beam of the only view; ×: its middle", ":")


def lesion_overview(
    views: Sequence[ViewLesions],
    mr: VolumeLesions,
    names: Sequence[str],
    breast: PicturedBreast,
    method: str,
) -> Png:
    """Per view mammogram and MR projection, and per lesion an axial and a sagittal slice of the MR volume.

    Args:
        views: of the case.
        mr: the undeformed volume with its cuts.
        names: of all lesions, which choose their colours.
        breast: whose it is.
        method: that predicted.
    """
    colours, with_curve = LesionColours(names), any(cut.curve is not None for cut in mr.cuts)
    # Two views beside one lesion leave room for its slices one above the other.
    stacked = len(views) > 1 and len(mr.cuts) == 1
    rows = max(len(views), len(mr.cuts))
    widths = [1.0, 1.0, 1.15] if stacked else [1.0, 1.0, 1.0, 1.0]
    with new_figure(3.5 * len(widths), 0.5 + 4.1 * rows) as figure:
        grid = figure.add_gridspec(rows, len(widths), width_ratios=widths)
        for row, view in enumerate(views):
            _draw_view(figure, grid[row, 0], grid[row, 1], view, breast.laterality, colours)
        for row, cut in enumerate(mr.cuts):
            for place, plane in enumerate(_PLANES):
                spot = grid[place, 2] if stacked else grid[row, 2 + place]
                _draw_cut(figure.add_subplot(spot), mr, cut, plane, breast.laterality, colours)
        figure.legend(handles=list(colours.keys(method, with_curve)), loc="outside lower center", ncols=4)
        doubt = ", one view: depth not determined" if with_curve else ""
        add_notice(figure, breast, f"Lesion localisation{doubt}")
        return to_png(figure)


def _draw_view(
    figure: Figure,
    left: SubplotSpec,
    right: SubplotSpec,
    view: ViewLesions,
    laterality: str,
    colours: LesionColours,
) -> None:
    """Mammogram and projection of one view, both with the lesions."""
    pictures = [("mammogram", left, view.mammogram), ("MR projection", right, view.projection)]
    for name, place, image in pictures:
        if image is None:
            continue
        axes = figure.add_subplot(place)
        show_detector_image(axes, image, laterality, view.view, f"{view.view}: {name}")
        for lesion, area in view.true.items():
            draw_area(axes, area, view.mammogram, colours.true(lesion), _MARKED)
        for lesion, area in view.predicted.items():
            draw_area(axes, area, view.mammogram, colours.predicted(lesion), _PREDICTED)


def _draw_cut(
    axes: Axes, mr: VolumeLesions, cut: LesionCut, plane: Plane, laterality: str, colours: LesionColours
) -> None:
    """A slice through a lesion with all lesions that it meets; its own is shown from beside where it misses it."""
    overlays = [SliceOverlay(mask, colours.true(name), _MARKED) for name, mask in mr.true.items()]
    overlays += [SliceOverlay(mask, colours.predicted(name), _PREDICTED) for name, mask in mr.predicted.items()]
    title = f"{laterality} MR, {plane}"
    off_mm = off_slice_mm(mr.true[cut.name], plane, cut.through) if cut.name in mr.true else 0.0
    if off_mm > 0.0:
        overlays.append(SliceOverlay(shadow(mr.true[cut.name], plane), colours.true(cut.name), _BESIDE))
    show_slice(axes, mr.volume, plane, cut.through, overlays, f"{cut.name}: {title}" if len(mr.cuts) > 1 else title)
    if off_mm > 0.0:
        add_corner_label(axes, f"marked (dotted)\n{whole_mm(off_mm)} off", "upper left")
    if cut.curve is not None:
        draw_curve(axes, cut.curve, plane, colours.predicted(cut.name))
        draw_point(axes, cut.through, plane, colours.predicted(cut.name))
