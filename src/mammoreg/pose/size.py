"""Whether image and model are of one size: what speaks of a wrong pixel spacing or thickness, or of a poor model."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.pose.alignment import align
from mammoreg.pose.outline import RadialOutline

SMALLEST, LARGEST = 0.6, 1.7
"""Relative sizes that are tried."""
_TOLERANCE = 0.005


def relative_size(points: Points, quads: NDArray[np.intp], view: ViewGeometry, outline: RadialOutline) -> float:
    """How many times as large as the outline the compressed breast's silhouette is.

    The factor by which the outline is enlarged to fit the silhouette best, its chest-wall edge and its place along it
    being free. The breast keeps its volume and the plates their distance, so that it is 1 but for the model's error.

    Args:
        points: surface nodes (N, 3) of the compressed breast in the plate frame, mm.
        quads: facets (Q, 4).
        view: geometry whose edge and middle are near.
        outline: the mammogram's outline.
    """

    def misfit(log_size: float) -> float:
        size = float(np.exp(log_size))
        enlarged = replace(outline, radius=outline.radius * size, centre_along_mm=outline.centre_along_mm * size)
        return align(points, quads, view, enlarged).robust_mm / size

    bounds = (float(np.log(SMALLEST)), float(np.log(LARGEST)))
    found = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": _TOLERANCE})
    return float(np.exp(found.x))


def imaged_volume_ml(pixels: int, view: ViewGeometry) -> float:
    """Volume between the plates of a part of the image, as if the breast filled their distance everywhere, ml.

    Args:
        pixels: of that part.
        view: geometry with a known thickness.
    """
    area_mm2 = pixels * (view.pixel_mm / view.middle_magnification) ** 2
    return area_mm2 * view.thickness_mm / 1000.0
