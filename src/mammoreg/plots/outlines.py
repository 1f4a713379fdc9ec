"""Outlines of the model against the mammogram's, before and after the boundary conditions are updated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from mammoreg.plots.detector import DetectorImage, line_key, show_detector_image
from mammoreg.plots.style import (
    TRUE_COLOUR,
    PicturedBreast,
    Png,
    add_notice,
    method_colour,
    method_line,
    new_figure,
    to_png,
)

BEFORE = ("rigid", "scaling")


@dataclass(frozen=True)
class ViewOutlines:
    """Outlines of one view as (forward, along), mm at the detector; nan where there is none.

    Attributes:
        view: name.
        image: what lies behind; black without a mammogram.
        outline: the mammogram's (M, 2).
        weight: where it is skin (1) and where not (0), shape (M,).
        models: silhouettes (K, 2) by method.
    """

    view: str
    image: DetectorImage
    outline: NDArray[np.float64]
    weight: NDArray[np.float64]
    models: Mapping[str, NDArray[np.float64]]


def outlines_before_and_after(views: Sequence[ViewOutlines], breast: PicturedBreast) -> Png:
    """Per view the outline under methods without mechanics (left) and with mechanics (right)."""
    with new_figure(8.0, 0.5 + 4.2 * len(views)) as figure:
        panels = figure.subplots(len(views), 2, squeeze=False)
        shown: list[str] = []
        for row, view in enumerate(views):
            for column, title in enumerate(("before: without mechanics", "after: between plates")):
                names = [name for name in view.models if (name in BEFORE) == (column == 0)]
                axes = panels[row, column]
                show_detector_image(axes, view.image, breast.laterality, view.view, f"{view.view}, {title}")
                _draw_outline(axes, view)
                for name in names:
                    forward, along = view.models[name].T
                    axes.plot(forward, along, method_line(name), color=method_colour(name), lw=1.3)
                shown += [name for name in names if name not in shown]
        keys = [line_key(TRUE_COLOUR, "outline in the image (faint: not skin, not used)")]
        keys += [line_key(method_colour(name), name, method_line(name)) for name in shown]
        figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
        add_notice(figure, breast, "Outlines of image and model")
        return to_png(figure)


def _draw_outline(axes: Axes, view: ViewOutlines) -> None:
    """The mammogram's outline, fainter the less it counts."""
    segments = np.stack([view.outline[:-1], view.outline[1:]], axis=1)
    weight = 0.5 * (view.weight[:-1] + view.weight[1:])
    lines = LineCollection(list(segments), colors=TRUE_COLOUR, linewidths=1.8, alpha=np.clip(weight, 0.3, 1.0))
    axes.add_collection(lines, autolim=False)
