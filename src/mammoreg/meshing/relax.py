"""Relaxation of a block mesh: shape of elements against fit to the surface."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from mammoreg.arrays import Floats, Integers
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.trilinear import CORNERS, jacobians, shape_gradients

_VOLUME_WEIGHT = 0.3
_POWER = 4
_NEAR_CORNERS = 0.8 * CORNERS


@dataclass(frozen=True)
class SquaredTerms:
    """The function |matrix x - offset|^2 of the flattened node positions x, weights included.

    Attributes:
        matrix: (C, 3 M).
        offset: (C,).
    """

    matrix: sparse.csr_array
    offset: Floats

    def scaled(self, weight: float) -> "SquaredTerms":
        """The same function times a weight."""
        return SquaredTerms(self.matrix * np.sqrt(weight), self.offset * np.sqrt(weight))

    @staticmethod
    def stack(terms: list["SquaredTerms"]) -> "SquaredTerms":
        """The sum of several."""
        matrix = sparse.csr_array(sparse.vstack([term.matrix for term in terms]))
        return SquaredTerms(matrix, np.concatenate([term.offset for term in terms]))


def relax(mesh: BlockMesh, cell: Floats, squares: SquaredTerms, iterations: int) -> BlockMesh:
    """Minimise distortion of the elements plus the squared terms, all nodes free.

    The distortion is that of Garanzha et al., "Foldover-free maps in 50 lines of code" (2021): conformal and volumetric
    terms whose regularised determinant also turns inverted elements back. It is taken close to the elements' corners,
    where blocks mapped to round bodies flatten, and to a power that makes the worst elements count most.

    Args:
        cell: edge lengths (3,) in mm of the ideal element along i, j, k.
        iterations: limit of the quasi-Newton method.
    """
    from scipy.optimize import minimize

    hexes = mesh.hexes()
    gradients = shape_gradients(_NEAR_CORNERS) * (2.0 / cell)
    determinant = np.linalg.det(_scaled(mesh.points, hexes, cell))
    # Regularise as much as the worst element needs, never to the point where a valid mesh feels it.
    epsilon = float(np.hypot(1e-2, min(determinant.min(), 0.0)))

    def energy(flat: Floats) -> tuple[float, Floats]:
        points = flat.reshape(-1, 3)
        shape, by_matrix = _distortion(_scaled(points, hexes, cell), epsilon)
        by_node = np.einsum("eqcd,qad->eac", by_matrix, gradients, optimize=True)
        gradient = _scatter(by_node, hexes, len(points)).ravel()
        residual = squares.matrix @ flat - squares.offset
        return shape + float(residual @ residual), gradient + 2.0 * (squares.matrix.T @ residual)

    result = minimize(
        energy, mesh.points.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": iterations, "maxcor": 20}
    )
    return BlockMesh(mesh.n, result.x.reshape(-1, 3))


def _scaled(points: Floats, hexes: Integers, cell: Floats) -> Floats:
    """Jacobian matrices (E, Q, 3, 3) relative to the ideal element."""
    return jacobians(points[hexes], _NEAR_CORNERS) * (2.0 / cell)


def _distortion(matrix: Floats, epsilon: float) -> tuple[float, Floats]:
    """Mean power of the distortion of matrices (E, Q, 3, 3), 1 at best, and its derivative by each matrix."""
    a, b, c = (matrix[..., column] for column in range(3))
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
    det = (a * cofactor[..., 0]).sum(axis=-1)
    root = np.sqrt(epsilon**2 + det**2)
    positive, slope = 0.5 * (det + root), 0.5 * (1.0 + det / root)
    shrink = positive ** (-2.0 / 3.0)
    conformal = (matrix**2).sum(axis=(-2, -1)) / 3.0 * shrink
    volumetric = 0.5 * (det**2 + 1.0) / positive
    by_det = -(2.0 / 3.0) * conformal / positive * slope
    by_det += _VOLUME_WEIGHT * (det - volumetric * slope) / positive
    by_matrix = (2.0 / 3.0 * shrink)[..., None, None] * matrix + by_det[..., None, None] * cofactor
    total = (conformal + _VOLUME_WEIGHT * volumetric) / (1.0 + _VOLUME_WEIGHT)
    outer = _POWER * total ** (_POWER - 1) / (total.size * (1.0 + _VOLUME_WEIGHT))
    return float((total**_POWER).mean()), outer[..., None, None] * by_matrix


def _scatter(by_node: Floats, hexes: Integers, count: int) -> Floats:
    """Sum element contributions (E, 8, 3) to nodes (count, 3)."""
    index = hexes.ravel()
    flat = by_node.reshape(-1, 3)
    return np.stack([np.bincount(index, flat[:, axis], minlength=count) for axis in range(3)], axis=1)
