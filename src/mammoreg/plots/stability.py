"""The stability study at a glance: Newton iterations of every scenario, and what did not converge."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from mammoreg.plots.style import NOTICE, Png, new_figure, to_png

Row = Mapping[str, Any]

_MARKERS = {"small": "o", "pendulous": "^", "flat": "s", "scan": "D"}
_LAW_NAMES = {
    "neo_hookean": "neo-Hookean",
    "exponential": "exponential",
    "linear": "linear",
    "fibres": "fibres",
    "stiffening_fibres": "stiffening fibres",
}
_FAILED, _WRONG = "#c2185b", "#e69f00"
_FEWEST, _MOST = 30, 1200


def stability_map(rows: Sequence[Row]) -> Png:
    """A panel for each law and tissue contrast: compression across, Poisson's ratio up.

    Each mark is a scenario: its shape the breast's, its size the mesh, its colour the Newton iterations; crosses did
    not converge, rings failed a check from outside. Scenarios that did not run are left out.

    Args:
        rows: of `stability.csv`.
    """
    ran = [row for row in rows if row["converged"] is not None]
    laws = [law for law in _LAW_NAMES if any(row["material"] == law for row in ran)] or ["neo_hookean"]
    contrasts = sorted({row["contrast"] for row in ran}) or [1]
    with new_figure(2.5 * len(contrasts) + 1.6, 1.75 * len(laws) + 1.2) as figure:
        panels = figure.subplots(len(laws), len(contrasts), squeeze=False, sharex=True, sharey=True)
        axis = _Places(ran)
        for (i, law), (j, contrast) in ((a, b) for a in enumerate(laws) for b in enumerate(contrasts)):
            here = [row for row in ran if row["material"] == law and row["contrast"] == contrast]
            _draw(panels[i, j], here, axis)
            if i == 0:
                panels[i, j].set_title(f"gland : fat = {contrast:g} : 1")
            if j == 0:
                panels[i, j].set_ylabel(f"{_LAW_NAMES[law]}\nPoisson's ratio (1)")
            if i == len(laws) - 1:
                panels[i, j].set_xlabel("compression (% of thickness)")
        _legend(figure, ran, panels)
        figure.suptitle(f"{_headline(ran)}  ·  {NOTICE}", fontsize=9, color="#444444")
        return to_png(figure)


class _Places:
    """Levels as evenly spaced places."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self.compressions = sorted({row["compression"] for row in rows})
        self.ratios = sorted({row["nu"] for row in rows})

    def of(self, row: Row) -> tuple[int, int]:
        return self.compressions.index(row["compression"]), self.ratios.index(row["nu"])


def _draw(axes: Axes, rows: Sequence[Row], places: _Places) -> None:
    cells: dict[tuple[int, int], list[Row]] = {}
    for row in rows:
        cells.setdefault(places.of(row), []).append(row)
    for (x, y), inside in cells.items():
        for k, row in enumerate(inside):
            _mark(axes, x + _offset(k, len(inside)), y, row)
    axes.set_xticks(range(len(places.compressions)), [f"{100 * c:.0f}" for c in places.compressions])
    axes.set_yticks(range(len(places.ratios)), [f"{nu:g}" for nu in places.ratios])
    axes.set_xlim(-0.6, len(places.compressions) - 0.4)
    axes.set_ylim(-0.6, len(places.ratios) - 0.4)
    for edge in np.arange(0.5, len(places.compressions) - 1):
        axes.axvline(edge, color="#eeeeee", lw=0.8, zorder=0)
    for edge in np.arange(0.5, len(places.ratios) - 1):
        axes.axhline(edge, color="#eeeeee", lw=0.8, zorder=0)


def _offset(k: int, count: int) -> float:
    """Place of the k-th of several marks in a cell of width 1."""
    return (k - 0.5 * (count - 1)) * min(0.3, 0.84 / count)


def _mark(axes: Axes, x: float, y: float, row: Row) -> None:
    size = 8.0 + 3.2 * row["elements"]
    if not row["converged"]:
        axes.scatter(x, y, s=size + 12, marker="x", c=_FAILED, linewidths=1.8, zorder=3)
        return
    ring = None if row["checks_passed"] else _WRONG
    axes.scatter(
        x,
        y,
        s=size,
        marker=_MARKERS.get(row["shape"], "o"),
        c=[row["newton_iterations"]],
        cmap="viridis",
        norm=LogNorm(_FEWEST, _MOST),
        edgecolors=ring or "none",
        linewidths=1.8 if ring else 0.0,
        zorder=2,
    )


def _legend(figure: Any, rows: Sequence[Row], panels: Any) -> None:
    scale = figure.colorbar(
        _scalar_map(), ax=panels, location="right", shrink=0.5, pad=0.02, ticks=[30, 50, 100, 200, 400, 800]
    )
    scale.ax.set_yticklabels(["30", "50", "100", "200", "400", "800"])
    scale.ax.minorticks_off()
    scale.set_label("Newton iterations of the whole closing")
    shapes = [name for name in _MARKERS if any(row["shape"] == name for row in rows)]
    marks = [Line2D([], [], ls="", marker=_MARKERS[s], color="#555555", ms=5, label=s) for s in shapes]
    for n in sorted({row["elements"] for row in rows}):
        width = np.sqrt(8.0 + 3.2 * n)
        marks.append(Line2D([], [], ls="", marker="o", color="#aaaaaa", ms=width, label=f"{n} elements a side"))
    marks.append(Line2D([], [], ls="", marker="x", color=_FAILED, ms=6, mew=1.8, label="not converged"))
    marks.append(
        Line2D([], [], ls="", marker="o", mfc="none", mec=_WRONG, mew=1.8, ms=6, label="fails a check from outside")
    )
    figure.legend(handles=marks, loc="outside lower center", ncols=5, fontsize=8)


def _scalar_map() -> Any:
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(LogNorm(_FEWEST, _MOST), "viridis")


def _headline(rows: Sequence[Row]) -> str:
    solved = [row for row in rows if row["converged"]]
    passed = sum(bool(row["checks_passed"]) for row in solved)
    return f"{len(rows)} scenarios ran, {len(solved)} converged, {passed} of these pass every check from outside"
