"""Breast-shaped masks with known geometry, breast frame, for tests of the mesher."""

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.geometry import Volume


def voxels(inside, low, high, spacing=1.4):
    """Mask of the points where `inside` (..., 3) -> bool holds."""
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return Volume(inside(grid).astype(np.uint8), np.asarray(low, dtype=float), np.full(3, spacing))


def on_back(height, mask, spacing=2.1):
    """Points of the surface posterior = height(medial, superior) that lie behind the mask's voxels."""
    axis = np.arange(-90.0, 90.0, spacing)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    points = np.stack([x, height(x, z), z], axis=-1).reshape(-1, 3)
    return points[mask.sample(points - [0.0, 2.0, 0.0], order=0) > 0]


def half_ellipsoid(a=60.0, depth=75.0, c=50.0, centre=(0.0, 0.0, 0.0)):
    """Half ellipsoid on a flat back; volume 2/3 pi a depth c."""

    def inside(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return (y < 0) & ((x / a) ** 2 + (y / depth) ** 2 + (z / c) ** 2 < 1)

    mask = voxels(inside, (-a - 7, -depth - 7, -c - 7), (a + 7, 7, c + 7))
    back = on_back(lambda x, z: 0.0 * x, mask)
    shift = np.asarray(centre)
    return Volume(mask.data, mask.origin + shift, mask.spacing), back + shift, np.array([0.0, -depth, 0.0]) + shift


def pendulous():
    """A neck narrower than the body that hangs from it along a bent axis: rays from one point leave it."""
    t = np.linspace(0.0, 1.0, 200)
    axis = np.stack([8.0 * t**2, -115.0 * t, -55.0 * t**2], axis=1)
    radius = np.interp(t, [0.0, 0.25, 0.6, 0.85, 1.0], [44.0, 29.0, 38.0, 34.0, 20.0])
    tree = cKDTree(axis)

    def inside(p):
        distance, near = tree.query(p.reshape(-1, 3))
        return ((distance < radius[near]) & (p[..., 1].ravel() < 0)).reshape(p.shape[:-1])

    mask = voxels(inside, (-60, -150, -100), (70, 7, 60))
    return mask, on_back(lambda x, z: 0.0 * x, mask), axis[-1] + [0.0, -14.0, -13.0]


def slab_on_bent_back():
    """Squeezed by the coil: tall and narrow, on a chest wall that bends forward above and below."""

    def height(x, z):
        return -0.008 * z**2 - 0.25 * x

    def inside(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return (y < height(x, z)) & (np.abs(x / 32) ** 4 + np.abs(y / 95) ** 2.5 + np.abs(z / 75) ** 2.5 < 1)

    mask = voxels(inside, (-40, -105, -85), (40, 25, 85))
    return mask, on_back(height, mask), np.array([5.0, -94.0, -12.0])
