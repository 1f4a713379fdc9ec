"""Displacements that turn elements inside out, healed by a small linear problem around those elements."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.linear_elastic import LinearElasticBody
from mammoreg.materials.elastic import neo_hookean

RINGS = (0, 1, 2)
_COMPRESSIBLE = neo_hookean(1.0, 0.3)


def untangled(model: HyperelasticModel, positions: Floats, held: NDArray[np.bool_], least: float) -> Floats:
    """Nodes (N, 3) whose elements are squeezed to det F below `least` less, if that can be had.

    The nodes of such elements, and of rings around them, take the small-strain equilibrium between the others.

    Args:
        model: the body.
        positions: deformed nodes (N, 3), mm.
        held: components (N, 3) that stay.
        least: det F to come to.
    """
    best, largest = positions, float(model.determinants(positions).min())
    folded = np.flatnonzero(model.determinants(positions).min(axis=1) < least)
    for rings in RINGS:
        if largest >= least:
            break
        tried = _relaxed(model, positions, held, folded, rings)
        found = float(model.determinants(tried).min())
        if found > largest:
            best, largest = tried, found
    return best


def _relaxed(
    model: HyperelasticModel, positions: Floats, held: NDArray[np.bool_], folded: NDArray[np.int64], rings: int
) -> Floats:
    free = np.zeros(len(model.points), dtype=bool)
    free[model.hexes[folded]] = True
    for _ in range(rings):
        free[model.hexes[free[model.hexes].any(axis=1)]] = True
    around = model.hexes[free[model.hexes].any(axis=1)]
    patch = LinearElasticBody(HyperelasticModel(model.points, around, _COMPRESSIBLE), held | ~free[:, None])
    return np.asarray(model.points + patch.solve(positions - model.points).displacement)
