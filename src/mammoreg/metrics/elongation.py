"""How much longer the compression makes the breast across the beam: the paper's macroscopic anisotropy."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Direction = Literal["lateral", "antero_posterior"]
_SIDE_DEG = 45.0
_TRUSTED = 0.5


def extents_mm(
    points: NDArray[np.float64], theta: NDArray[np.float64], weight: NDArray[np.float64]
) -> dict[Direction, float | None]:
    """Extents of a silhouette in front of the image's chest-wall edge, in the units of its points.

    Only rays on which the mammogram's outline is skin count, the same for every silhouette of a view, so that
    extents can be subtracted. `lateral` needs such rays on both sides, farther than 45 degrees from the forward
    direction, as an MLO rarely has them; `antero_posterior` needs one within them.

    Args:
        points: the silhouette (K, 2) as (forward, along), mm.
        theta: angles (K,) of its rays from the forward direction, rad.
        weight: trust (K,) in the outline on each ray.
    """
    angle = np.degrees(theta)
    trusted = (weight >= _TRUSTED) & np.isfinite(points).all(axis=1)
    sides = (trusted & (angle < -_SIDE_DEG), trusted & (angle > _SIDE_DEG))
    middle = trusted & (np.abs(angle) <= _SIDE_DEG)
    lateral = float(points[sides[1], 1].max() - points[sides[0], 1].min()) if all(map(np.any, sides)) else None
    return {"lateral": lateral, "antero_posterior": float(points[middle, 0].max()) if middle.any() else None}
