"""Which part of an MR volume shows the wanted breast."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Bools
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_laterality import SideEvidence, side_evidence

HILL_MM = 15.0
"""A hill of the body lower than this is no breast."""
SMALLER_SHARE = 0.4
"""Beside the highest hill, a lateral one of less than this share of its height is no breast but arm, fold or ghost."""
WRONG_SIDE_MM = 30.0
"""A breast that lies further than this beyond the patient's middle is the other one, if both sides are in view."""


@dataclass(frozen=True)
class BreastPlace:
    """Where the wanted breast stands, breast frame, mm.

    Attributes:
        apex: its most anterior point.
        midline_m: next to it.
        side: what tells of its side, where it is alone in view.
        heights_mm: of the wanted breast above the midline and, where both are in view, of the other one.
    """

    apex: NDArray[np.float64]
    midline_m: float
    heights_mm: tuple[float, ...] = ()
    side: SideEvidence | None = None


def find_breast(body: Bools, grid: Volume) -> BreastPlace:
    """Find the breast of the wanted side in a coarse body mask of the breast frame.

    The body's anterior relief, seen along the superior axis, is one hill or two; of two, the wanted one is the lateral
    one in this frame (smaller m), and the valley next to it is the midline.

    Raises:
        DataError: nothing protrudes by at least 15 mm, or only the other breast does.
    """
    from scipy import signal  # takes a second to import

    relief = _relief(body, grid)
    profile = ndimage.gaussian_filter1d(np.sort(relief, axis=1)[:, -3:].mean(axis=1), 1.5)
    low = [profile.min()]
    peaks = signal.find_peaks(np.concatenate([low, profile, low]), prominence=HILL_MM)[0] - 1
    if peaks.size == 0:
        raise DataError("no breast found in the MR volume: nothing protrudes; check orientation and field of view")
    m = grid.origin[0] + grid.spacing[0] * np.arange(grid.shape[0])
    wanted = _wanted_hill(profile, m, peaks)
    if m[wanted] > WRONG_SIDE_MM and m[0] < -2.0 * WRONG_SIDE_MM:
        raise DataError("the only breast in the MR volume is on the other side: check laterality")
    further = peaks[peaks > wanted]
    end = int(further[0]) if further.size else wanted
    valley = wanted + int(np.argmin(profile[wanted : end + 1])) if further.size else grid.shape[0]
    midline_m = float(m[0] + valley * grid.spacing[0])
    apex = _apex(relief, body, grid, wanted)
    side = None if further.size else side_evidence(body, grid, apex)
    return BreastPlace(apex, midline_m, _heights(profile, m, wanted, further), side)


def _heights(
    profile: NDArray[np.float64], m: NDArray[np.float64], wanted: int, further: NDArray[np.intp]
) -> tuple[float, ...]:
    """Heights above the valley, mm, of the wanted breast and of the highest further one that is wholly in view."""
    if not further.size:
        return ()
    other = int(further[np.argmax(profile[further])])
    between = profile[wanted : other + 1].min()
    whole = m[-1] - m[other] > m[other] - m[wanted + int(np.argmin(profile[wanted : other + 1]))]
    return (float(profile[wanted] - between), float(profile[other] - between)) if whole else ()


def _wanted_hill(profile: NDArray[np.float64], m: NDArray[np.float64], peaks: NDArray[np.intp]) -> int:
    """Index of the lateral breast among the peaks of the relief's profile along m."""
    highest = int(peaks[np.argmax(profile[peaks])])
    for peak in peaks[peaks < highest]:
        saddle = profile[peak:highest].min()
        if m[highest] > 0.0 or profile[peak] - saddle > SMALLER_SHARE * (profile[highest] - saddle):
            return int(peak)
    return highest


def _apex(relief: NDArray[np.float64], body: Bools, grid: Volume, hill: int) -> NDArray[np.float64]:
    """The most anterior point within a few voxels of a hill's ridge, mm."""
    first = max(hill - 3, 0)
    strip = ndimage.gaussian_filter(relief[first : hill + 4], 1.0)
    row, s = np.unravel_index(int(np.argmax(strip)), strip.shape)
    m = first + int(row)
    return grid.to_world(np.array([m, int(np.argmax(body[m, :, s])), s]))


def _relief(body: Bools, grid: Volume) -> NDArray[np.float64]:
    """Height (m, s) in mm of the body's first voxel from the front above the grid's posterior end."""
    first = np.where(body.any(axis=1), np.argmax(body, axis=1), body.shape[1])
    return np.asarray((body.shape[1] - first) * grid.spacing[1], dtype=float)
