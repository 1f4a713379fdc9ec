"""What the segmentation found in the MR volume."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.plots.detector import line_key
from mammoreg.plots.slices import Plane, SliceOverlay, show_slice
from mammoreg.plots.style import PURPLE, SKY, VERMILLION, YELLOW, PicturedBreast, Png, add_notice, new_figure, to_png

BREAST_COLOUR, GLAND_COLOUR, MESH_COLOUR = YELLOW, SKY, VERMILLION


def segmentation(
    volume: Volume,
    mask: Volume,
    gland: Volume,
    mesh: Volume | None,
    nipple: NDArray[np.float64],
    breast: PicturedBreast,
) -> Png:
    """Axial and sagittal slice through the nipple with the borders of breast, gland and mesh.

    Args:
        volume: MR volume, LPS.
        mask, gland: masks of the breast and of its gland.
        mesh: mask of the voxels inside the mesh, where there is one.
        nipple: (3,), mm; marked, and the slices pass through it.
        breast: whose it is.
    """
    planes: tuple[Plane, ...] = ("axial", "sagittal")
    overlays = [SliceOverlay(mask, BREAST_COLOUR), SliceOverlay(gland, GLAND_COLOUR)]
    keys = [line_key(BREAST_COLOUR, "breast"), line_key(GLAND_COLOUR, "gland")]
    if mesh is not None:
        overlays.append(SliceOverlay(mesh, MESH_COLOUR, "--"))
        keys.append(line_key(MESH_COLOUR, "mesh", "--"))
    with new_figure(8.6, 4.6) as figure:
        for axes, plane in zip(figure.subplots(1, 2), planes, strict=True):
            show_slice(axes, volume, plane, nipple, overlays, f"{breast.laterality} MR, {plane}")
            across, up = {"axial": (0, 1), "sagittal": (1, 2)}[plane]
            axes.plot(nipple[across], nipple[up], "+", color=PURPLE, ms=9, mew=1.6)
        figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
        add_notice(figure, breast, "Segmentation, slices through the nipple (+)")
        return to_png(figure)
