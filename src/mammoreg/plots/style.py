"""What all pictures share: colours, scale bars, orientation letters, the notice, and the PNG itself."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke
from numpy.typing import NDArray

Png = NDArray[np.uint8]

# Okabe and Ito's palette, which readers with any colour vision tell apart (jfly.uni-koeln.de/color).
ORANGE, SKY, GREEN, YELLOW = "#e69f00", "#56b4e9", "#009e73", "#f0e442"
BLUE, VERMILLION, PURPLE = "#0072b2", "#d55e00", "#cc79a7"
TRUE_COLOUR = VERMILLION
PREDICTED_COLOUR = SKY
METHOD_COLOURS = {"rigid": PURPLE, "scaling": YELLOW, "plate": GREEN, "updated": PREDICTED_COLOUR}
METHOD_LINES = {"rigid": ":", "scaling": "--", "plate": "--", "updated": "-"}
OTHER_METHOD_COLOURS = (BLUE, ORANGE, "#999999")
LESION_COLOURS = (VERMILLION, SKY, YELLOW, "#ffffff", BLUE, PURPLE, GREEN)
NOTICE = "research use only"

_STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "lines.linewidth": 1.4,
    "figure.facecolor": "white",
}


def method_colour(method: str) -> str:
    """Colour of a method, the same in every picture; methods without one of their own share three others."""
    return METHOD_COLOURS.get(method, OTHER_METHOD_COLOURS[sum(method.encode()) % len(OTHER_METHOD_COLOURS)])


def method_line(method: str) -> str:
    """Line style of a method, which tells it apart without colours."""
    return METHOD_LINES.get(method, "-.")


@dataclass(frozen=True)
class PicturedBreast:
    """Whose breast a picture shows, as every picture says.

    Attributes:
        case: id of the case.
        laterality: "L" or "R".
    """

    case: str
    laterality: str

    @property
    def head(self) -> str:
        """Case and side."""
        return f"{self.case}  ·  {'right' if self.laterality == 'R' else 'left'} breast"


def halo(width: float) -> list[AbstractPathEffect]:
    """A dark edge around a line of some width, which keeps it apart from bright tissue."""
    return [withStroke(linewidth=width + 1.4, foreground="#000000", alpha=0.55)]


def whole_mm(value: float) -> str:
    """A coordinate to the millimetre; nothing is minus zero."""
    return f"{round(float(value)) + 0:d} mm"


@contextmanager
def new_figure(
    width_inch: float, height_inch: float, layout: Literal["compressed"] | None = "compressed"
) -> Iterator[Figure]:
    """A figure in this package's style, free of pyplot's global state."""
    with matplotlib.rc_context(cast(Any, _STYLE)):
        figure = Figure(figsize=(width_inch, height_inch), layout=layout)
        FigureCanvasAgg(figure)
        yield figure


def to_png(figure: Figure, dpi: int = 130) -> Png:
    """Render to PNG bytes (uint8) without the metadata that would tie them to a program version."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, bbox_inches="tight", pad_inches=0.08, metadata={"Software": None})
    return np.frombuffer(buffer.getvalue(), dtype=np.uint8)


def add_notice(figure: Figure, breast: PicturedBreast, what: str) -> None:
    """Head line with case, side and content, and the notice that no picture goes without."""
    figure.suptitle(f"{breast.head}  ·  {what}  ·  {NOTICE}", fontsize=9, color="#444444")


def add_scale_bar(axes: Axes, length_mm: float = 20.0) -> None:
    """Bar of a given length in the lower right corner of axes whose data are in mm and whose aspect is equal."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    end = right - 0.05 * (right - left)
    start = end - np.sign(right - left) * length_mm
    height = bottom + 0.05 * (top - bottom)
    outline = [withStroke(linewidth=4.0, foreground="black")]
    axes.plot([start, end], [height, height], color="white", lw=2.2, path_effects=outline, solid_capstyle="butt")
    axes.text(
        0.5 * (start + end),
        height + 0.015 * (top - bottom),
        f"{length_mm:g} mm",
        color="white",
        ha="center",
        va="bottom",
        fontsize=7.5,
        path_effects=[withStroke(linewidth=2.0, foreground="black")],
    )


def add_corner_label(axes: Axes, text: str, corner: str) -> None:
    """Text in a corner (`upper left`, `upper right`, `lower left`) or at the middle of an edge (`left`, `top`...)."""
    x, horizontal = {"left": (0.02, "left"), "right": (0.98, "right")}.get(corner.split()[-1], (0.5, "center"))
    y, vertical = {
        "upper": (0.98, "top"),
        "top": (0.98, "top"),
        "lower": (0.02, "bottom"),
        "bottom": (0.02, "bottom"),
    }.get(corner.split()[0], (0.5, "center"))
    axes.text(
        x,
        y,
        text,
        transform=axes.transAxes,
        ha=horizontal,
        va=vertical,
        color="white",
        fontsize=9,
        fontweight="bold",
        path_effects=[withStroke(linewidth=2.0, foreground="black")],
    )


def grey_window(image: NDArray[Any], inside: NDArray[np.bool_]) -> tuple[float, float]:
    """Display range from the 1 % and 99.5 % quantiles of the pixels inside; the whole image's where none is."""
    values = np.asarray(image, dtype=float)[inside] if inside.any() else np.asarray(image, dtype=float).ravel()
    values = values[np.isfinite(values)]
    if values.size == 0:
        return 0.0, 1.0
    low, high = np.quantile(values, [0.01, 0.995])
    return float(low), float(max(high, low + 1e-9))
