"""How far marks lie from the breast that they are to be in."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry import Volume


def distance_outside_mm(points: Points, mask: Volume) -> NDArray[np.float64]:
    """Distance (N,) in mm of points (N, 3) from the nearest voxel centre of a mask (non-zero = inside); 0 within it.

    Raises:
        ValueError: the mask is empty.
    """
    inside = np.asarray(mask.data) != 0
    if not inside.any():
        raise ValueError("the mask is empty")
    distance, _ = cKDTree(mask.centres(inside)).query(points)
    return np.asarray(np.where(mask.sample(points, order=0) != 0, 0.0, distance))


def distance_outside_px(pixel: NDArray[np.float64], mask: NDArray[np.bool_]) -> float:
    """Distance of a pixel (2,) as (column, row) from the nearest one of a mask (rows, columns); 0 within it.

    Raises:
        ValueError: the mask is empty.
    """
    if not mask.any():
        raise ValueError("the mask is empty")
    column, row = np.rint(pixel).astype(int)
    rows, columns = mask.shape
    if 0 <= row < rows and 0 <= column < columns and mask[row, column]:
        return 0.0
    found = np.nonzero(mask)
    return float(np.sqrt(np.min((found[0] - pixel[1]) ** 2 + (found[1] - pixel[0]) ** 2)))
