"""Distances between predicted and true places."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry


def breast_scale_mm(geometry: ViewGeometry) -> float:
    """Size in mm of a pixel at the middle of the plates: detector distances divided by the magnification there."""
    return geometry.pixel_mm / geometry.middle_magnification


def detector_distance_mm(
    predicted: NDArray[np.float64], true: NDArray[np.float64], geometry: ViewGeometry
) -> NDArray[np.float64]:
    """Distances (...) in mm of pixels (..., 2) as (column, row), at the magnification of the plates' middle."""
    return np.asarray(np.linalg.norm(np.subtract(predicted, true), axis=-1) * breast_scale_mm(geometry))


def distance_to_curve_mm(point: Points, curve: Points) -> float:
    """Distance of a point (3,) to the nearest of a polyline's vertices (N, 3), closely spaced, mm."""
    return float(cKDTree(curve).query(np.asarray(point, dtype=float))[0])
