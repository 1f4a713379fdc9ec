"""The half-ellipsoid breast that the solvers are compared on, and how ours closes plates on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, held_back
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.materials.elastic import neo_hookean
from mammoreg.meshing.block import BlockMesh

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

HALF_AXES_MM = (65.0, 80.0, 55.0)
"""Lateral, depth and height."""
HEIGHT_MM = 2.0 * HALF_AXES_MM[2]
COARSEST = 7
MU_KPA, POISSON = 10.0, 0.49
OPTIONS = ClosingOptions(
    tolerance_mm=0.005,
    damping=1e-9,
    rests=1,
    contact_factors=(),
    rule="nodes",
    steps=2,
    penalty_per_mm=100.0,
    band_mm=0.02,
)


@dataclass(frozen=True)
class Body:
    """The breast in the plate frame (medial, posterior, height), mm.

    Attributes:
        block: its mesh.
        core: nodes of the back that are fixed wholly; the others slide in the back's plane.
    """

    block: BlockMesh
    core: Indices

    @property
    def back(self) -> BackCondition:
        """Condition of the back's nodes."""
        nodes = self.block.back_nodes()
        held = np.zeros((len(nodes), 3), dtype=bool)
        held[:, 1] = True
        held[np.isin(nodes, self.core)] = True
        return held_back(nodes, held)

    def closing(self) -> Closing:
        """Two infinite frictionless planes around it."""
        model = HyperelasticModel(self.block.points, self.block.hexes(), neo_hookean(MU_KPA, POISSON))
        return Closing(model, self.block.skin_quads(), self.back, options=OPTIONS)


def breast(elements: int) -> Body:
    """The transfinite mesh with 7 elements a side, every one cut by its own trilinear map.

    Raises:
        ValueError: the number of elements a side is not a multiple of 7.
    """
    if elements % COARSEST:
        raise ValueError(f"elements a side must be a multiple of {COARSEST}, not {elements}")
    block = BlockMesh(COARSEST, _half_ball(COARSEST) * HALF_AXES_MM).subdivide(elements // COARSEST)
    line = np.abs(2.0 * np.arange(elements + 1) / elements - 1.0) <= 1.0 / COARSEST + 1e-9
    return Body(block, block.node_grid()[:, :, 0][np.ix_(line, line)].ravel())


def _half_ball(n: int) -> Floats:
    """Nodes of the half unit ball at depths >= 0: the smooth map of the cube to the ball."""
    across, depth = np.linspace(-1.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1)
    d, h, w = (grid.ravel() for grid in np.meshgrid(depth, across, across, indexing="ij"))
    return np.stack([_bent(w, d, h), -_bent(d, w, h), _bent(h, d, w)], axis=1)


def _bent(along: Floats, first: Floats, second: Floats) -> Floats:
    return along * np.sqrt(1.0 - (first**2 + second**2) / 2.0 + (first * second) ** 2 / 3.0)
