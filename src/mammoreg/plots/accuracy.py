"""Errors over a cohort, and error against computing time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatter, StrMethodFormatter

from mammoreg.plots.style import NOTICE, Png, method_colour, new_figure, to_png

LIMIT_MM = 5.0
PLAIN_NUMBERS = StrMethodFormatter("{x:g}")
_PAPER_COLOUR = "#c2185b"
_MARKERS = {"CC": "o", "MLO": "s", "3D": "^"}


@dataclass(frozen=True)
class ErrorPanel:
    """Distances in mm by method, and the paper's means of the methods that it has."""

    title: str
    distances: Mapping[str, Sequence[float]]
    paper_mean: Mapping[str, float]


def error_panels(panels: Sequence[ErrorPanel]) -> Png:
    """One panel a quantity: a dot for each distance, a bar for the mean, a diamond for the paper's mean."""
    widths = [1.0 + 0.5 * len(panel.distances) for panel in panels]
    with new_figure(sum(widths), 3.1) as figure:
        places = np.atleast_1d(figure.subplots(1, len(panels), width_ratios=widths))
        for axes, panel in zip(places, panels, strict=True):
            _draw_errors(axes, panel)
        figure.suptitle(NOTICE, fontsize=8, color="#444444")
        return to_png(figure)


def _draw_errors(axes: Axes, panel: ErrorPanel) -> None:
    for place, (method, values) in enumerate(panel.distances.items()):
        found = np.sort(np.asarray(values, dtype=float))
        spread = place + 0.32 * (np.arange(len(found)) % 7 - 3) / 3
        axes.plot(spread, found, "o", color=method_colour(method), ms=3.8, alpha=0.6, mec="#555555", mew=0.4)
        if len(found):
            axes.hlines(found.mean(), place - 0.36, place + 0.36, color="#111111", lw=1.8)
    top = _upper_limit(panel)
    for place, method in enumerate(panel.distances):
        if method in panel.paper_mean:
            _draw_paper(axes, place, panel.paper_mean[method], top)
    axes.axhline(LIMIT_MM, color="#999999", lw=0.9, ls="--")
    axes.set_xticks(range(len(panel.distances)), list(panel.distances), fontsize=7)
    axes.set_xlim(-0.6, max(len(panel.distances), 1) - 0.4)
    axes.set_ylim(0.0, top)
    axes.set_ylabel("distance (mm)")
    axes.set_title(panel.title)


def _upper_limit(panel: ErrorPanel) -> float:
    """Own distances decide; the paper's rigid registration lies far beyond."""
    return 1.12 * max([1.4 * LIMIT_MM, *(float(value) for values in panel.distances.values() for value in values)])


def _draw_paper(axes: Axes, place: float, mean_mm: float, top: float) -> None:
    """A diamond at the paper's mean, or an arrow with the number where it lies beyond the axis."""
    if mean_mm < top:
        axes.plot(place, mean_mm, "D", mfc="none", mec=_PAPER_COLOUR, ms=6, mew=1.3)
        return
    text = f"{mean_mm:.0f} ↑"
    axes.text(place, 0.985 * top, text, color=_PAPER_COLOUR, fontsize=7.5, ha="center", va="top")


@dataclass(frozen=True)
class RuntimePoint:
    """One run: its method, view, elements a side, mean error in mm and time in s."""

    method: str
    view: str
    elements: int
    error_mm: float
    total_s: float


def error_against_runtime(points: Sequence[RuntimePoint]) -> Png:
    """Error against time on logarithmic axes: each run faint, the means of a method over meshes joined by a line."""
    with new_figure(6.4, 4.4) as figure:
        axes = figure.subplots()
        for method in dict.fromkeys(point.method for point in points):
            runs = [point for point in points if point.method == method]
            for run in runs:
                marker = _MARKERS.get(run.view, "o")
                axes.plot(run.total_s, run.error_mm, marker, color=method_colour(method), ms=3.2, alpha=0.35, mew=0)
            _draw_means(axes, method, runs)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(PLAIN_NUMBERS)
            axis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.9)))
        axes.grid(True, which="both", color="#e6e6e6", lw=0.6)
        axes.set_xlabel("processor time from mesh to solution (s)")
        axes.set_ylabel("mean distance to the truth (mm)")
        axes.legend()
        axes.set_title("Error against computing time; numbers: elements a side")
        figure.suptitle(NOTICE, fontsize=8, color="#444444")
        return to_png(figure)


def _draw_means(axes: Axes, method: str, runs: Sequence[RuntimePoint]) -> None:
    """One point a mesh, with its elements a side beside it."""
    elements = sorted({run.elements for run in runs})
    chosen = [[run for run in runs if run.elements == n] for n in elements]
    time = [float(np.mean([run.total_s for run in same])) for same in chosen]
    error = [float(np.mean([run.error_mm for run in same])) for same in chosen]
    axes.plot(time, error, "-o", color=method_colour(method), lw=1.5, ms=6, label=method)
    for n, x, y in zip(elements, time, error, strict=True):
        axes.annotate(str(n), (x, y), textcoords="offset points", xytext=(5, 4), fontsize=8)
