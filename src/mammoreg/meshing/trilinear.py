"""The trilinear hexahedron: shape functions on [-1, 1]^3 in VTK node order."""

import numpy as np

from mammoreg.arrays import Floats

CORNERS: Floats = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
"""Local coordinates (8, 3) of the nodes."""

GAUSS_POINTS: Floats = CORNERS / np.sqrt(3.0)
"""Local coordinates (8, 3) of the 2 x 2 x 2 Gauss points; each has weight 1."""


def shape_functions(local: Floats) -> Floats:
    """Values (..., 8) of the shape functions at local coordinates (..., 3)."""
    factors = 0.5 * (1.0 + local[..., None, :] * CORNERS)
    return np.asarray(factors.prod(axis=-1))


def shape_gradients(local: Floats) -> Floats:
    """Derivatives (..., 8, 3) of the shape functions by the local coordinates (..., 3)."""
    factors = 0.5 * (1.0 + local[..., None, :] * CORNERS)
    x, y, z = np.moveaxis(factors, -1, 0)
    half = 0.5 * CORNERS
    return np.stack([half[:, 0] * y * z, half[:, 1] * x * z, half[:, 2] * x * y], axis=-1)


def jacobians(nodes: Floats, local: Floats) -> Floats:
    """Jacobian matrices (M, Q, 3, 3), d position / d local, of hexahedra with nodes (M, 8, 3) at local (Q, 3)."""
    return np.asarray(np.einsum("mac,qad->mqcd", nodes, shape_gradients(local), optimize=True))


def volumes(nodes: Floats) -> Floats:
    """Volumes (M,) of hexahedra with nodes (M, 8, 3); exact, since 2 x 2 x 2 points integrate the determinant."""
    return np.asarray(np.linalg.det(jacobians(nodes, GAUSS_POINTS)).sum(axis=1))
