"""A gland that fits every breast: a flat lens in the coordinates of the block, the same on every mesh."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CENTRE = (0.1, 0.0, 0.45)
HALF_AXES = (0.6, 0.13, 0.4)
"""Of the lens along lateral-medial [-1, 1], inferior-superior [-1, 1] and back-front [0, 1].

Its thickness of 13 % of the breast's leaves a rigid gland room at 70 % compression: the fat above and below it then
comes to 20 % of its height. One layer of elements holds it on meshes of 5 and 7 a side, two on 10 and 14."""
_SOFT = 0.35
_SAMPLES = 6


def gland_share(elements: int) -> Floats:
    """Gland's share (n^3,) of each element of a block of n elements a side, in the block's order.

    The share falls smoothly from 1 inside to 0 at the lens's border.
    """
    fine = (np.arange(elements * _SAMPLES) + 0.5) / (elements * _SAMPLES)
    w, v, u = np.meshgrid(fine, 2.0 * fine - 1.0, 2.0 * fine - 1.0, indexing="ij")
    offsets = [(x - c) / a for x, c, a in zip((u, v, w), CENTRE, HALF_AXES, strict=True)]
    radius = np.sqrt(sum(o**2 for o in offsets))
    share = np.clip((1.0 - radius) / _SOFT, 0.0, 1.0)
    share = share**2 * (3.0 - 2.0 * share)
    cells = share.reshape(elements, _SAMPLES, elements, _SAMPLES, elements, _SAMPLES)
    return np.asarray(cells.mean(axis=(1, 3, 5)).ravel())
