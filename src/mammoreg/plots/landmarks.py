"""Landmarks: predicted against true places, in mammograms and in a second MR volume."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.plots.detector import DetectorImage, draw_displacements, line_key, show_detector_image
from mammoreg.plots.style import (
    TRUE_COLOUR,
    PicturedBreast,
    Png,
    add_corner_label,
    add_notice,
    add_scale_bar,
    method_colour,
    new_figure,
    to_png,
)

_OUTLINE_COLOUR = "#d0d0d0"
_AROUND_MM = 35.0


@dataclass(frozen=True)
class ViewLandmarks:
    """Landmarks of one view, (N, 2) as (forward, along) in mm at the detector; nan where there is no prediction."""

    view: str
    image: DetectorImage
    true: Points
    predicted: Mapping[str, Points]


def landmarks_in_mammograms(views: Sequence[ViewLandmarks], breast: PicturedBreast) -> Png:
    """Per view and method the true places (circles) joined with the predicted ones (crosses)."""
    methods = list(dict.fromkeys(name for view in views for name in view.predicted))
    with new_figure(3.9 * len(methods), 0.5 + 4.0 * len(views)) as figure:
        panels = figure.subplots(len(views), len(methods), squeeze=False)
        for row, view in enumerate(views):
            for column, method in enumerate(methods):
                axes = panels[row, column]
                show_detector_image(axes, view.image, breast.laterality, view.view, f"{view.view}, {method}")
                if method in view.predicted:
                    draw_displacements(axes, view.true, view.predicted[method], TRUE_COLOUR, method_colour(method))
        _finish(figure, breast, "Landmarks in the mammogram")
        return to_png(figure)


def landmarks_in_volume(mask: Volume, true: Points, predicted: Mapping[str, Points], breast: PicturedBreast) -> Png:
    """Landmarks (N, 3), LPS mm, in a second MR volume of which only the body's silhouette is shown."""
    planes = (("from the side", 1, 2, "APIS"), ("from the front", 0, 2, "RLIS"))
    with new_figure(3.9 * len(planes), 0.5 + 3.6 * len(predicted)) as figure:
        panels = figure.subplots(len(predicted), len(planes), squeeze=False)
        for row, (method, points) in enumerate(predicted.items()):
            for column, (title, horizontal, vertical, letters) in enumerate(planes):
                axes = panels[row, column]
                _draw_silhouette(axes, mask, horizontal, vertical)
                pair = [horizontal, vertical]
                draw_displacements(axes, true[:, pair], points[:, pair], TRUE_COLOUR, method_colour(method))
                _limit_to(axes, true[:, pair])
                axes.set_title(f"{method}, {title}")
                axes.set_xlabel(f"{'xyz'[horizontal]} LPS (mm)")
                axes.set_ylabel(f"{'xyz'[vertical]} LPS (mm)")
                for letter, edge in zip(letters, ("left", "right", "bottom", "top"), strict=True):
                    add_corner_label(axes, letter, edge)
                add_corner_label(axes, f"{breast.laterality} 3D", "upper left")
                add_scale_bar(axes)
        _finish(figure, breast, "Landmarks between the plates (second MR volume)")
        return to_png(figure)


def _draw_silhouette(axes: Any, mask: Volume, horizontal: int, vertical: int) -> None:
    """Border of a body's silhouette along the axis that is neither of the two."""
    across = 3 - horizontal - vertical
    shadow = np.pad((mask.data != 0).any(axis=across).astype(float), 1)
    x, y = (mask.origin[a] + mask.spacing[a] * np.arange(-1, mask.shape[a] + 1) for a in (horizontal, vertical))
    axes.set_facecolor("black")
    axes.contour(x, y, shadow.T, levels=[0.5], colors=[_OUTLINE_COLOUR], linewidths=1.2)
    axes.set_aspect("equal")


def _limit_to(axes: Any, points: Points) -> None:
    """Show what lies around the points, not the chest behind the breast."""
    low, high = points.min(axis=0) - _AROUND_MM, points.max(axis=0) + _AROUND_MM
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def _finish(figure: Any, breast: PicturedBreast, what: str) -> None:
    keys = [line_key(TRUE_COLOUR, "circle: true place"), line_key("#555555", "cross: predicted place")]
    figure.legend(handles=keys, loc="outside lower center", ncols=2)
    add_notice(figure, breast, what)
