"""Outlines as polylines of pixels: even steps along them, normals, grey values across them."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Floats32

Polyline = NDArray[np.float64]


def resampled(polyline: Polyline, step: float) -> Polyline:
    """A polyline (N, 2) with points a step apart."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(2, round(length[-1] / step) + 1))
    return np.stack([np.interp(at, length, polyline[:, axis]) for axis in range(2)], axis=1)


def outward_normals(polyline: Polyline) -> Polyline:
    """Unit normals (N, 2) of an outline (N, 2) of (column, row).

    It runs from its low-row to its high-row end where the chest wall lies at column 0; a closed one runs the same way.
    """
    tangent = np.gradient(polyline, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-9)[:, None], dtype=float)


def across(polyline: Polyline, normals: Polyline, steps: NDArray[np.float64]) -> Polyline:
    """Places (N, K, 2) along the normals of a polyline, outwards by the steps (K,), all in pixels."""
    return polyline[:, None, :] + steps[None, :, None] * normals[:, None, :]


def grey_values(image: Floats32, places: Polyline) -> NDArray[np.float64]:
    """Values of an image at places (..., 2) of (column, row), linear between pixels."""
    values = ndimage.map_coordinates(image, [places[..., 1], places[..., 0]], order=1, mode="nearest")
    return np.asarray(values, dtype=float)
