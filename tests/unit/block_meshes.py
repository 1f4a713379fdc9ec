"""A breast-like block mesh and a smooth compression with a known inverse, for tests."""

import numpy as np

from mammoreg.meshing.block import BlockMesh


def half_ellipsoid(n=5, semi_axes=(60.0, 75.0, 55.0)):
    """Half-ellipsoid in the breast frame: back at posterior 0, nipple at posterior -depth."""
    side, depth = np.linspace(-1.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1)
    k, j, i = np.meshgrid(depth, side, side, indexing="ij")
    medial, superior = i * np.sqrt(1.0 - 0.5 * j**2), j * np.sqrt(1.0 - 0.5 * i**2)
    round_off = np.sqrt(1.0 - 0.85 * k**2)
    points = np.stack([medial * round_off, -k, superior * round_off], axis=-1) * np.asarray(semi_axes)
    return BlockMesh(n, points.reshape(-1, 3))


def compress(points):
    """Breast frame -> plate frame, mm: flattened, spread, and moved."""
    return points * [1.25, 1.25, 0.64] + [2.0, -1.0, 4.0]


def expand(points):
    """Inverse of `compress`."""
    return (points - [2.0, -1.0, 4.0]) / [1.25, 1.25, 0.64]
