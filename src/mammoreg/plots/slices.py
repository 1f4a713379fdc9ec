"""Slices of an MR volume with the borders of masks, in radiological orientation."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.plots.style import add_corner_label, add_scale_bar, grey_window, halo, whole_mm

Plane = Literal["axial", "sagittal", "coronal"]

# normal, horizontal and vertical axis; letters at left, right, bottom, top. Anterior is up in axial slices and
# left in sagittal ones; the patient's right is the picture's left.
_PLANES: dict[Plane, tuple[int, int, int, str]] = {
    "axial": (2, 0, 1, "RLPA"),
    "sagittal": (0, 1, 2, "APIS"),
    "coronal": (1, 0, 2, "RLIS"),
}


@dataclass(frozen=True)
class SliceOverlay:
    """Border of a mask volume on any grid in the frame of the slice, in a colour."""

    mask: Volume
    colour: str
    style: Any = "-"


def show_slice(
    axes: Axes, volume: Volume, plane: Plane, through: NDArray[Any], overlays: list[SliceOverlay], title: str
) -> None:
    """Show the slice of an LPS volume through a point (3,) in mm, with the borders of masks."""
    normal, horizontal, vertical, letters = _PLANES[plane]
    pixels = _slice_pixels(volume, plane, through)
    low, high = grey_window(pixels, pixels > 0.05 * np.nanmax(pixels, initial=0.0))
    x, y = (volume.origin[a] + volume.spacing[a] * np.arange(volume.shape[a]) for a in (horizontal, vertical))
    half_x, half_y = 0.5 * volume.spacing[horizontal], 0.5 * volume.spacing[vertical]
    extent = (x[0] - half_x, x[-1] + half_x, y[0] - half_y, y[-1] + half_y)
    axes.imshow(pixels, cmap="gray", vmin=low, vmax=high, extent=extent, origin="lower", aspect="equal")
    for overlay in overlays:
        _draw_border(axes, overlay, plane, through)
    axes.set_xlim(extent[:2])
    axes.set_ylim(extent[2:] if plane != "axial" else extent[:1:-1])
    axes.set_title(f"{title}, {'xyz'[normal]} = {whole_mm(through[normal])}")
    axes.set_xlabel(f"{'xyz'[horizontal]} LPS (mm)")
    axes.set_ylabel(f"{'xyz'[vertical]} LPS (mm)")
    for letter, edge in zip(letters, ("left", "right", "bottom", "top"), strict=True):
        add_corner_label(axes, letter, edge)
    add_scale_bar(axes)


def draw_curve(axes: Axes, curve: NDArray[Any], plane: Plane, colour: str) -> None:
    """Draw a curve (N, 3), mm, as it is seen along the slice's normal, with its ends marked."""
    _, horizontal, vertical, _ = _PLANES[plane]
    across, up = curve[:, horizontal], curve[:, vertical]
    axes.plot(across, up, ":", color=colour, lw=1.6, path_effects=halo(1.6))
    axes.plot(across[[0, -1]], up[[0, -1]], ".", color=colour, ms=4.5)


def draw_point(axes: Axes, point: NDArray[Any], plane: Plane, colour: str) -> None:
    """Mark a point (3,), mm, with a cross."""
    _, horizontal, vertical, _ = _PLANES[plane]
    axes.plot(point[horizontal], point[vertical], "x", color=colour, ms=6.0, mew=1.6, path_effects=halo(1.6))


def off_slice_mm(mask: Volume, plane: Plane, through: NDArray[Any]) -> float:
    """How far a mask lies from the slice through a point (3,), mm; 0 where the slice cuts it."""
    normal = _PLANES[plane][0]
    filled = np.flatnonzero((mask.data > 0.5).any(axis=tuple(a for a in range(3) if a != normal)))
    if not len(filled):
        return 0.0
    ends = mask.origin[normal] + mask.spacing[normal] * (filled[[0, -1]] + [-0.5, 0.5])
    return float(max(0.0, ends[0] - through[normal], through[normal] - ends[1]))


def shadow(mask: Volume, plane: Plane) -> Volume:
    """A mask filled along the slice's normal: what a slice beside it would show of it."""
    normal = _PLANES[plane][0]
    middle = mask.origin.copy()
    middle[normal] += 0.5 * (mask.shape[normal] - 1) * mask.spacing[normal]
    spacing = mask.spacing.copy()
    spacing[normal] = 1e6
    return Volume(np.asarray((mask.data > 0.5).any(axis=normal, keepdims=True)), middle, spacing, mask.frame)


def _slice_pixels(volume: Volume, plane: Plane, through: NDArray[Any]) -> NDArray[np.float64]:
    """Nearest slice of a volume as pixels (vertical, horizontal); zeros where the point lies beyond the grid."""
    normal, horizontal, vertical, _ = _PLANES[plane]
    index = round(float((through[normal] - volume.origin[normal]) / volume.spacing[normal]))
    if not 0 <= index < volume.shape[normal]:
        return np.zeros((volume.shape[vertical], volume.shape[horizontal]))
    taken = np.take(volume.data, index, axis=normal).astype(float)
    return np.asarray(taken.T)


def _draw_border(axes: Axes, overlay: SliceOverlay, plane: Plane, through: NDArray[Any]) -> None:
    """Border of the mask in the slice; nothing where the slice misses it."""
    mask = overlay.mask
    pixels = _slice_pixels(mask, plane, through)
    if not (pixels > 0.5).any():
        return
    _, horizontal, vertical, _ = _PLANES[plane]
    x, y = (mask.origin[a] + mask.spacing[a] * np.arange(-1, mask.shape[a] + 1) for a in (horizontal, vertical))
    border = axes.contour(
        x, y, np.pad(pixels, 1), levels=[0.5], colors=[overlay.colour], linewidths=1.4, linestyles=[overlay.style]
    )
    border.set_path_effects(halo(1.4))
