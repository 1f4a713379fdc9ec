"""Runs of elements: what the element routines work on, a few at a time, so that it all stays in the cache."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats, Integers
from mammoreg.materials.elastic import ElasticMaterial

RUN = 64


@dataclass(frozen=True)
class ElementRun:
    """Some elements in a row.

    Attributes:
        elements: their place among all.
        hexes: corners (C, 8).
        gradients: of the shape functions in the undeformed body (C, 8, Q, 3), 1/mm.
        weights: undeformed volume of each quadrature point (C, Q), mm3.
        material: of these elements.
    """

    elements: slice
    hexes: Integers
    gradients: Floats
    weights: Floats
    material: ElasticMaterial

    def deformation_gradients(self, positions: Floats) -> Floats:
        """F by component (3 spatial, 3 material, C, Q) at nodes (N, 3) in mm."""
        count, corners, quadrature = self.gradients.shape[:3]
        flat = self.gradients.reshape(count, corners, 3 * quadrature)
        moved = positions[self.hexes].transpose(0, 2, 1) @ flat
        components = moved.reshape(count, 3, quadrature, 3).transpose(1, 3, 0, 2)
        # One contiguous array per component makes what follows fast.
        return np.ascontiguousarray(components)


def element_runs(
    hexes: Integers, gradients: Floats, weights: Floats, material: ElasticMaterial
) -> Iterator[ElementRun]:
    """All elements in runs; gradients (E, 8, Q, 3), material with one value per element."""
    for start in range(0, len(hexes), RUN):
        part = slice(start, min(start + RUN, len(hexes)))
        yield ElementRun(part, hexes[part], gradients[part], weights[part], material.part(part))


def cofactors(gradient: Floats) -> tuple[Floats, Floats]:
    """Cofactors (3, 3, ...) and determinants (...) of matrices by component (3, 3, ...)."""
    found = np.empty_like(gradient)
    for row in range(3):
        _cofactor_row(gradient, row, found[row])
    return found, _along_first_row(gradient, found[0])


def determinants(gradient: Floats) -> Floats:
    """Determinants (...) of matrices by component (3, 3, ...)."""
    return _along_first_row(gradient, _cofactor_row(gradient, 0, np.empty_like(gradient[0])))


def _cofactor_row(gradient: Floats, row: int, found: Floats) -> Floats:
    above, below = gradient[(row + 1) % 3], gradient[(row + 2) % 3]
    for j in range(3):
        k, m = (j + 1) % 3, (j + 2) % 3
        np.multiply(above[k], below[m], out=found[j])
        found[j] -= above[m] * below[k]
    return found


def _along_first_row(gradient: Floats, first: Floats) -> Floats:
    return np.asarray(gradient[0, 0] * first[0] + gradient[0, 1] * first[1] + gradient[0, 2] * first[2])


def by_point(components: Floats) -> Floats:
    """From (3, 3, C, Q) to contiguous (C, Q, 3, 3)."""
    return np.ascontiguousarray(components.transpose(2, 3, 0, 1))
