"""Motion of a breast between plates as a whole: a tall one that tips over goes sideways."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats


def sideways_drift_mm(
    points: Floats, deformed: Floats, hexes: NDArray[np.integer], volume: Floats, back: NDArray[np.integer]
) -> float:
    """Mean displacement of a body's volume along the plates and across the beam, medially, beside that of its back.

    Args:
        points, deformed: nodes (N, 3) before and between the plates, plate frame (medial, posterior, height), mm.
        hexes: elements (E, 8).
        volume: of each element (E,), undeformed.
        back: nodes (B,) of the back.
    """
    medial = deformed[:, 0] - points[:, 0]
    return float(np.average(medial[hexes].mean(axis=1), weights=volume) - medial[back].mean())
