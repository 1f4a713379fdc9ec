"""Which part of an MR volume shows the wanted breast."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_body import Mask

BREAST_PROMINENCE_MM = 15.0
"""A ridge of the body lower than this is no breast."""


@dataclass(frozen=True)
class BreastPlace:
    """Where the wanted breast stands, breast frame, mm: its most anterior point and the midline next to it."""

    apex: NDArray[np.float64]
    midline_m: float


def find_breast(body: Mask, grid: Volume) -> BreastPlace:
    """Find the breast of the wanted side in a coarse body mask of the breast frame.

    The body's anterior relief, seen along the superior axis, is one hill or two; of two, the wanted one is the lateral
    one in this frame (smaller m), and the valley between them is the midline.

    Raises:
        DataError: nothing protrudes by at least 15 mm.
    """
    relief = _relief(body, grid)
    profile = ndimage.gaussian_filter1d(np.sort(relief, axis=1)[:, -3:].mean(axis=1), 1.5)
    padded = np.concatenate([[profile.min()], profile, [profile.min()]])
    peaks, properties = signal.find_peaks(padded, prominence=BREAST_PROMINENCE_MM)
    if peaks.size == 0:
        raise DataError("no breast found in the MR volume: nothing protrudes; check orientation and field of view")
    best = np.sort(peaks[np.argsort(-properties["prominences"], kind="stable")[:2]]) - 1
    wanted = int(best[0])
    valley = int(best[0] + np.argmin(profile[best[0] : best[1] + 1])) if best.size == 2 else body.shape[0]
    strip = relief[max(wanted - 3, 0) : wanted + 4]
    row, s = np.unravel_index(int(np.argmax(ndimage.gaussian_filter(strip, 1.0))), strip.shape)
    m = max(wanted - 3, 0) + int(row)
    p = int(np.argmax(body[m, :, s]))
    return BreastPlace(grid.to_world(np.array([m, p, s])), float(grid.origin[0] + valley * grid.spacing[0]))


def _relief(body: Mask, grid: Volume) -> NDArray[np.float64]:
    """Height (m, s) in mm of the body's first voxel from the front above the grid's posterior end."""
    first = np.where(body.any(axis=1), np.argmax(body, axis=1), body.shape[1])
    return np.asarray((body.shape[1] - first) * grid.spacing[1], dtype=float)
