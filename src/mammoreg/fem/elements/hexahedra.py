"""Trilinear hexahedra: gradients and quadrature weights of the undeformed mesh, by scikit-fem."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mammoreg.arrays import Floats, Integers

if TYPE_CHECKING:
    import skfem

VTK_IN_SKFEM = [0, 4, 3, 1, 7, 5, 2, 6]
"""scikit-fem's corner c is corner VTK_IN_SKFEM[c] of the VTK order."""


@dataclass(frozen=True)
class Hexahedra:
    """Quadrature of the undeformed hexahedra.

    Attributes:
        gradients: of the shape functions, (E, Q, 8, 3), 1/mm, corners in VTK order.
        weights: undeformed volume of each quadrature point, (E, Q), mm3.
        volume: undeformed volume of each element, (E,), mm3.
    """

    gradients: Floats
    weights: Floats
    volume: Floats


def skfem_basis(points: Floats, hexes: Integers) -> "skfem.Basis":
    """scikit-fem's basis of trilinear hexahedra (corners in VTK order) with 2 x 2 x 2 Gauss points."""
    import skfem  # when it is needed: settings are read without it

    mesh = skfem.MeshHex(np.ascontiguousarray(points.T), np.ascontiguousarray(hexes[:, VTK_IN_SKFEM].T))
    return skfem.Basis(mesh, skfem.ElementHex1(), intorder=3)


def hexahedra(points: Floats, hexes: Integers) -> Hexahedra:
    """Gradients and weights of hexahedra (E, 8) in VTK order over points (N, 3) in mm.

    Raises:
        ValueError: an element is turned inside out at a Gauss point.
    """
    inverted = np.flatnonzero(jacobians(points, hexes).min(axis=1) <= 0.0)
    if inverted.size:
        raise ValueError(f"{inverted.size} of {len(hexes)} elements are inside out, the first is {inverted[0]}")
    basis = skfem_basis(points, hexes)
    weights = np.array(basis.dx)
    gradients = np.empty((*weights.shape, 8, 3))
    for corner, vtk in enumerate(VTK_IN_SKFEM):
        gradients[:, :, vtk] = np.moveaxis(basis.basis[corner][0].grad, 0, -1)
    return Hexahedra(gradients, weights, weights.sum(axis=1))


def jacobians(points: Floats, hexes: Integers) -> Floats:
    """Signed Jacobian determinants (E, 8) at the Gauss points, mm3 per unit of the reference cube [0, 1]^3."""
    return np.asarray(np.linalg.det(np.einsum("qac,eai->eqci", reference_gradients(), points[hexes])))


def reference_gradients() -> Floats:
    """Gradients (8 Gauss points, 8 corners in VTK order, 3) of the shape functions on the cube [0, 1]^3."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    gauss = 0.5 + 0.5 / np.sqrt(3.0) * (2.0 * corners - 1.0)
    factors = np.where(corners[None] > 0.5, gauss[:, None], 1.0 - gauss[:, None])
    slopes = 2.0 * corners - 1.0
    product = [slopes[None, :, c] * factors[:, :, (c + 1) % 3] * factors[:, :, (c + 2) % 3] for c in range(3)]
    return np.stack(product, axis=-1)
