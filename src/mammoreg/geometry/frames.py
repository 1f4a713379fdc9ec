"""Maps between the patient (LPS), breast and plate frames; see the package docstring."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points

Laterality = Literal["L", "R"]
Frame = Literal["LPS", "breast", "plate"]


def lps_to_breast(points: Points, laterality: Laterality) -> Points:
    """Carry points (..., 3) in mm from LPS to the breast frame."""
    return _mirrored(points, laterality)


def breast_to_lps(points: Points, laterality: Laterality) -> Points:
    """Carry points (..., 3) in mm from the breast frame to LPS."""
    return _mirrored(points, laterality)


def _mirrored(points: Points, laterality: Laterality) -> Points:
    """Points mirrored in x for a left breast; the map is its own inverse."""
    mirrored = np.array(points, dtype=float, copy=True)
    if laterality == "L":
        mirrored[..., 0] *= -1.0
    return mirrored


def plate_rotation(angle_deg: float) -> NDArray[np.float64]:
    """Rotation (3, 3) from the breast to the plate frame at a projection angle in degrees.

    Its rows are the plate axes in breast coordinates; the last one points from the breast to the source, in LPS
    (-s sin a, 0, cos a) with s = +1 for a left and -1 for a right breast.
    """
    a = np.deg2rad(angle_deg)
    return np.array([[np.cos(a), 0.0, -np.sin(a)], [0.0, 1.0, 0.0], [np.sin(a), 0.0, np.cos(a)]])


def breast_to_plate(points: Points, angle_deg: float) -> Points:
    """Turn points (..., 3) in mm from the breast into the plate frame."""
    return np.asarray(points, dtype=float) @ plate_rotation(angle_deg).T


def plate_to_breast(points: Points, angle_deg: float) -> Points:
    """Turn points (..., 3) in mm from the plate into the breast frame."""
    return np.asarray(points, dtype=float) @ plate_rotation(angle_deg)


def plate_to_lps_affine(angle_deg: float, laterality: Laterality) -> NDArray[np.float64]:
    """The plate frame to LPS, (4, 4), mm."""
    affine = np.eye(4)
    affine[:3, :3] = plate_rotation(angle_deg).T
    if laterality == "L":
        affine[0] *= -1.0
    return affine


def plate_to_lps(points: Points, angle_deg: float, laterality: Laterality) -> Points:
    """Map points (..., 3) in mm from the plate frame to LPS."""
    return breast_to_lps(plate_to_breast(points, angle_deg), laterality)
