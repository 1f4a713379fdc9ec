"""Forces of the elements from their strain energy alone: no stress or tangent of the solver is used."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.meshing.trilinear import CORNERS, GAUSS_POINTS, jacobians, shape_gradients
from mammoreg.scenes.gland import Floats
from mammoreg.scenes.tissue import SceneTissue

_STEP = 1e-5
"""Of the central differences, as a share of an element's size."""


class InnerForces:
    """Trilinear hexahedra with a mean dilatation: W(F / J^(1/3)) at the Gauss points and K/2 (mean J - 1)^2.

    Args:
        points: undeformed nodes (N, 3), mm.
        hexes: corners (E, 8), VTK order.
        tissue: energy and bulk modulus of each element.
    """

    def __init__(self, points: Floats, hexes: NDArray[np.integer], tissue: SceneTissue) -> None:
        self.hexes, self.tissue = hexes, tissue
        reference = jacobians(points[hexes], GAUSS_POINTS)
        inverse = np.linalg.inv(reference)
        self.gradients = np.einsum("qad,eqdc->eqac", shape_gradients(GAUSS_POINTS), inverse)
        self.weights = np.linalg.det(reference)
        self.volume = self.weights.sum(axis=1)
        self.size = float(self.volume.mean()) ** (1.0 / 3.0)

    def deformation_gradients(self, positions: Floats) -> Floats:
        """F (E, Q, 3, 3) at the Gauss points of deformed nodes (N, 3)."""
        return np.asarray(np.einsum("eac,eqad->eqcd", positions[self.hexes], self.gradients, optimize=True))

    def dilatation(self, positions: Floats) -> Floats:
        """Mean det F (E,) of each element, its deformed over its undeformed volume."""
        det = _determinant(self.deformation_gradients(positions))
        return np.asarray((self.weights * det).sum(axis=1) / self.volume)

    def element_forces(self, positions: Floats) -> Floats:
        """Derivative (E, 8, 3) of each element's energy by its nodes, mN, by central differences."""
        gradient, step = self.deformation_gradients(positions), _STEP * self.size
        force = np.empty((len(self.hexes), 8, 3))
        for node in range(8):
            for axis in range(3):
                shift = np.zeros_like(gradient)
                shift[:, :, axis] = step * self.gradients[:, :, node]
                higher, lower = self._energy(gradient + shift), self._energy(gradient - shift)
                force[:, node, axis] = (higher - lower) / (2.0 * step)
        return force

    def _energy(self, gradient: Floats) -> Floats:
        """Energy (E,) of the elements, microjoule (kPa mm3)."""
        det = _determinant(gradient)
        isochoric = (self.weights * self.tissue.energy_kpa(gradient, det)).sum(axis=1)
        dilatation = (self.weights * det).sum(axis=1) / self.volume - 1.0
        return np.asarray(isochoric + 0.5 * self.tissue.bulk_kpa * dilatation**2 * self.volume)


def least_corner_jacobian(positions: Floats, hexes: NDArray[np.integer]) -> float:
    """Smallest scaled Jacobian at the corners of deformed elements: 1 for bricks, below 0 where one is folded."""
    matrices = jacobians(positions[hexes], CORNERS)
    lengths = np.linalg.norm(matrices, axis=2).prod(axis=2)
    return float((np.linalg.det(matrices) / np.maximum(lengths, 1e-12)).min())


def _determinant(matrix: Floats) -> Floats:
    a, b, c = (matrix[..., row, :] for row in range(3))
    return np.asarray((a * np.cross(b, c)).sum(axis=-1))
