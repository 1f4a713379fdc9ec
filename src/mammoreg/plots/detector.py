"""Images and marks on the mammogram's detector, in mm from the chest-wall edge and from the middle row."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from mammoreg.arrays import Bools
from mammoreg.imaging.views import projection_of
from mammoreg.localization.lesions import LesionArea
from mammoreg.plots.style import add_corner_label, add_scale_bar, grey_window, halo


@dataclass(frozen=True)
class DetectorImage:
    """A canonical image (column 0 at the chest wall), perhaps thinned to blocks of pixels.

    Attributes:
        pixels: one value per block (ceil(rows / step), columns / step).
        breast: mask of the breast, same shape; it sets the grey values' range and the part that is shown.
        pixel_mm: pixel spacing of the full image at the detector.
        rows: rows of the full image.
        step: pixels a side of a block.
    """

    pixels: NDArray[Any]
    breast: Bools
    pixel_mm: float
    rows: int
    step: int = 1

    @property
    def block_mm(self) -> float:
        """Side of a block at the detector."""
        return self.step * self.pixel_mm

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top border in mm, row 0 on top."""
        rows, columns = self.pixels.shape
        top = -0.5 * self.rows * self.pixel_mm
        return 0.0, columns * self.block_mm, top + rows * self.block_mm, top


def pixels_to_mm(pixels: NDArray[Any], rows: int, pixel_mm: float) -> NDArray[np.float64]:
    """Pixel indices (..., 2) as (column, row) to mm from the chest-wall edge and from the middle row."""
    pixels = np.asarray(pixels, dtype=float)
    return np.stack([pixels[..., 0] + 0.5, pixels[..., 1] - 0.5 * (rows - 1)], axis=-1) * pixel_mm


def show_detector_image(axes: Axes, image: DetectorImage, laterality: str, view: str, title: str) -> None:
    """Show an image as it is hung: a right breast's chest wall at the right, lateral or superior on top."""
    low, high = grey_window(image.pixels, image.breast)
    axes.imshow(image.pixels, cmap="gray", vmin=low, vmax=high, extent=image.extent, aspect="equal")
    _crop_to_breast(axes, image)
    if laterality == "R":
        axes.invert_xaxis()
    axes.set_title(title)
    axes.set_xlabel("from chest-wall edge (mm)")
    axes.set_ylabel("along chest wall (mm)")
    axes.set_facecolor("black")
    add_corner_label(axes, f"{laterality} {view}", "upper left" if laterality == "R" else "upper right")
    projection = projection_of(view)
    if not projection.hung_as_canonical:
        axes.invert_yaxis()
    add_corner_label(axes, "superior" if projection.upright else "lateral", "top")
    add_corner_label(axes, "inferior" if projection.upright else "medial", "bottom")
    add_scale_bar(axes)


def _crop_to_breast(axes: Axes, image: DetectorImage, margin_mm: float = 8.0) -> None:
    """Limit the axes to the breast and a margin; the whole image where no breast is marked."""
    left, right, bottom, top = image.extent
    if image.breast.any():
        rows, columns = (np.flatnonzero(image.breast.any(axis=axis)) for axis in (1, 0))
        first, last = rows[0] * image.block_mm - margin_mm, (rows[-1] + 1) * image.block_mm + margin_mm
        right = min(right, (columns[-1] + 1) * image.block_mm + margin_mm)
        bottom, top = min(bottom, top + last), max(top, top + first)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)


def draw_area(axes: Axes, area: LesionArea, image: DetectorImage, colour: str, style: str = "-") -> None:
    """Draw the border of a lesion's area, which is in the full image's pixels."""
    part = np.pad(area.mask.astype(float), 1)
    x, y = pixels_to_mm(np.array(area.first) - 1, image.rows, image.pixel_mm)
    border = axes.contour(
        x + image.pixel_mm * np.arange(part.shape[1]),
        y + image.pixel_mm * np.arange(part.shape[0]),
        part,
        levels=[0.5],
        colors=[colour],
        linewidths=1.6,
        linestyles=style,
    )
    border.set_path_effects(halo(1.6))


def draw_displacements(
    axes: Axes, true_mm: NDArray[Any], predicted_mm: NDArray[Any], true: str, predicted: str
) -> None:
    """Draw pairs of points (N, 2) in mm, joined by lines: circles at the truth, crosses at the prediction."""
    seen = np.isfinite(true_mm).all(axis=1) & np.isfinite(predicted_mm).all(axis=1)
    for a, b in zip(true_mm[seen], predicted_mm[seen], strict=True):
        axes.plot([a[0], b[0]], [a[1], b[1]], color=predicted, lw=0.9)
    axes.plot(true_mm[seen, 0], true_mm[seen, 1], "o", mfc="none", mec=true, ms=4.5, mew=1.2)
    axes.plot(predicted_mm[seen, 0], predicted_mm[seen, 1], "x", color=predicted, ms=4.0, mew=1.2)


def line_key(colour: str, label: str, style: str = "-") -> Line2D:
    """A line for a legend."""
    return Line2D([], [], color=colour, ls=style, label=label)
