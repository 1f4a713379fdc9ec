"""Small bodies for the tests of the finite elements, plate frame."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.meshing.block import BlockMesh

Floats = NDArray[np.float64]


def block(n: int, size: tuple[float, float, float] = (60.0, 60.0, 60.0)) -> BlockMesh:
    """A box of n x n x n hexahedra centred at the origin: i medial, j height, k from the back (posterior) forward."""
    m = n + 1
    k, j, i = np.meshgrid(np.arange(m), np.arange(m), np.arange(m), indexing="ij")
    x = (i.ravel() / n - 0.5) * size[0]
    y = (0.5 - k.ravel() / n) * size[1]
    z = (j.ravel() / n - 0.5) * size[2]
    return BlockMesh(n, np.stack([x, y, z], axis=1))


def distorted(n: int, seed: int = 0, amount: float = 0.12, size: float = 60.0) -> BlockMesh:
    """A box whose inner nodes are shifted by up to a share of an element's side."""
    mesh = block(n, (size, size, size))
    rng = np.random.default_rng(seed)
    inner = (np.abs(mesh.points) < 0.5 * size - 1e-9).all(axis=1)
    points = mesh.points.copy()
    points[inner] += amount * size / n * rng.uniform(-1.0, 1.0, (int(inner.sum()), 3))
    return BlockMesh(n, points)


def rotation(axis: tuple[float, float, float], angle: float) -> Floats:
    """Rotation matrix (3, 3) about an axis by an angle in radians."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
