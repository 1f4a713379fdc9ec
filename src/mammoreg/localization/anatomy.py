"""How a clinician names a place in the breast: clock position, distance to the nipple, depths."""

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry.frames import Laterality

_CENTRAL_MM = 5.0


def clock_position(point: Points, nipple: Points, laterality: Laterality) -> str:
    """Clock position as seen facing the patient, to the half hour: 12:00 is above, 3:00 towards the patient's left.

    So 9:00 is lateral in a right breast and medial in a left one.

    Args:
        point, nipple: positions (3,), breast frame, mm.
        laterality: "L" or "R".

    Returns:
        "1:00" to "12:30", or "central" within 5 mm of the nipple's antero-posterior line.
    """
    medial, _, superior = np.asarray(point, dtype=float) - np.asarray(nipple, dtype=float)
    if np.hypot(medial, superior) < _CENTRAL_MM:
        return "central"
    to_patients_left = medial if laterality == "R" else -medial
    half_hours = int(np.floor(np.degrees(np.arctan2(to_patients_left, superior)) / 15.0 + 0.5)) % 24
    return f"{half_hours // 2 or 12}:{30 * (half_hours % 2):02d}"


def distance_to(points: Points, surface: Points) -> float:
    """Distance in mm of a point (3,) to the nearest of a surface's points (N, 3)."""
    return float(cKDTree(surface).query(np.asarray(points, dtype=float))[0])
