"""Whether the one breast that an MR volume shows is of the side that the user says.

Place and shape tell, both by the header's axes: a right breast lies towards the patient's right, and the body falls
away beside it, round the flank, more than towards the breastbone. A volume that is mirrored against its own header
contradicts the true side as a wrong table does; one that shows both breasts contradicts nothing, mirrored or not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Bools
from mammoreg.errors import DataError
from mammoreg.geometry import Volume

BESIDE_MM = (40.0, 110.0)
"""The body beside a breast, distance from the breast's apex."""
FEWEST = 3
"""Coarse voxels on both sides that tell anything."""
BAND_MM = 40.0
"""Above and below the apex."""
FALL_MM = 8.0
"""A difference of height beyond this tells the side: 10 to 277 mm in 45 breasts, whole volumes or parts of them
(twins, standing, mri), and -11 to -71 mm with the sides exchanged."""
PLACE_MM = 30.0
"""A breast beyond this from the origin's sagittal plane lies on one side of it."""
CHOSEN_ORIGIN_MM = 3.0
"""An origin this near to the volume's border or middle may have been set by a program: then place tells nothing."""


@dataclass(frozen=True)
class SideEvidence:
    """What a volume that shows one breast tells of its side; each positive where it agrees with the user's.

    Attributes:
        fall_mm: how much lower the body's surface is laterally than medially; None where the volume does not show it.
        lateral_mm: how far laterally of the origin the apex lies; None where the origin tells nothing.
    """

    fall_mm: float | None
    lateral_mm: float | None


def side_evidence(body: Bools, grid: Volume, apex: NDArray[np.float64]) -> SideEvidence:
    """Evidence of a coarse body mask in the breast frame, where lateral is the direction of smaller m.

    Args:
        body: mask on `grid`.
        grid: that shows one breast.
        apex: most anterior point (3,) of the breast, mm.
    """
    ends = grid.origin[0], grid.to_world(np.array(grid.shape) - 1)[0]
    chosen = min(abs(ends[0]), abs(ends[1]), abs(ends[0] + ends[1])) < CHOSEN_ORIGIN_MM + grid.spacing[0]
    return SideEvidence(_fall_mm(body, grid, apex), None if chosen else -float(apex[0]))


def _fall_mm(body: Bools, grid: Volume, apex: NDArray[np.float64]) -> float | None:
    """Height of the surface medially less laterally, at the greatest distance from the apex that is in view there."""
    m, s = (grid.origin[i] + grid.spacing[i] * np.arange(grid.shape[i]) for i in (0, 2))
    part = body[:, :, np.abs(s - apex[2]) < BAND_MM]
    front = np.where(part.any(axis=1), part.shape[1] - np.argmax(part, axis=1), 0) * grid.spacing[1]
    height = ndimage.gaussian_filter1d(np.median(front, axis=1), 1.0)
    away = np.arange(BESIDE_MM[0], BESIDE_MM[1], grid.spacing[0])
    lateral, medial = (np.interp(apex[0] + sign * away, m, height, left=np.nan, right=np.nan) for sign in (-1.0, 1.0))
    difference = medial - lateral
    seen = difference[np.isfinite(difference)]
    return float(seen[-2:].mean()) if len(seen) >= FEWEST else None


def check_side(evidence: SideEvidence) -> str:
    """What speaks against the user's side, in words; empty where nothing does.

    Raises:
        DataError: the volume shows the other breast, or is mirrored.
    """
    shape, place = evidence.fall_mm, evidence.lateral_mm
    other_shape, other_place = shape is not None and shape < -FALL_MM, place is not None and place < -PLACE_MM
    if other_shape and shape is not None:
        raise DataError(
            "the one breast in the MR volume is shaped like one of the other side, for the body falls away "
            f"{-shape:.0f} mm further on its medial side: check laterality, and that the volume is not mirrored"
        )
    if not other_place or place is None:
        return ""
    if shape is None or shape < FALL_MM:
        raise DataError(
            f"the one breast in the MR volume lies {-place:.0f} mm on the other side of the body's middle: check "
            "laterality, and the volume's origin"
        )
    return (
        f"the breast's place, {-place:.0f} mm on the other side of the origin, contradicts its side, which its shape "
        "confirms: the volume's origin may be shifted"
    )
