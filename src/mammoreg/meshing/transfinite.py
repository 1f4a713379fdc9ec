"""Transfinite interpolation after Gordon and Hall (paper, section II-A)."""

import numpy as np

from mammoreg.arrays import Floats


def fill_face(face: Floats) -> Floats:
    """Fill the inside of a face of nodes (m, m, 3) from its four edges (Coons patch)."""
    return _blend(face, 0) + _blend(face, 1) - _blend(_blend(face, 0), 1)


def fill_block(block: Floats) -> Floats:
    """Fill the inside of a block of nodes (m, m, m, 3) from its six faces by the Boolean sum of projectors."""
    x, y, z = (_blend(block, axis) for axis in range(3))
    xy, yz, zx = _blend(x, 1), _blend(y, 2), _blend(z, 0)
    return x + y + z - xy - yz - zx + _blend(xy, 2)


def _blend(values: Floats, axis: int) -> Floats:
    """Linear interpolation along one axis between the first and the last slice."""
    m = values.shape[axis]
    shape = [1] * values.ndim
    shape[axis] = m
    t = np.linspace(0.0, 1.0, m).reshape(shape)
    first, last = values.take([0], axis=axis), values.take([m - 1], axis=axis)
    return (1.0 - t) * first + t * last
