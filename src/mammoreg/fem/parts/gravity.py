"""Gravity as a dead load: the body's weight, shared among its nodes by the shape functions."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.elements.hexahedra import VTK_IN_SKFEM, skfem_basis
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.system import node_dofs

STANDARD_GRAVITY = 9.80665
"""m/s2."""
_MN_PER_SI = 1e-6  # kg/m3 times m/s2 times mm3 is 1e-9 N


@dataclass(frozen=True)
class Gravity:
    """Constant forces on nodes, brought on with the load steps.

    Attributes:
        force: (N, 3), mN.
        rest: undeformed nodes (N, 3), mm, where the potential is zero.
    """

    force: Floats
    rest: Floats

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (N, 3)."""
        return node_dofs(np.arange(len(self.force))[:, None])

    def terms(self, _positions: Floats) -> tuple[Floats, Floats]:
        """Residual (N, 3), mN, and no stiffness."""
        return -self.force, np.zeros((len(self.force), 3, 3))

    def energy_mj(self, positions: Floats) -> float:
        """Potential of the load."""
        return -1e-3 * float(np.sum(self.force * (positions[: len(self.force)] - self.rest)))

    def renewed(self, _positions: Floats) -> "Gravity":
        """Itself."""
        return self

    def at(self, load_factor: float) -> "Gravity":
        """The load at a load factor."""
        return replace(self, force=load_factor * self.force)


def gravity(model: HyperelasticModel, density_kg_m3: float | Floats, direction: NDArray[np.floating]) -> Gravity:
    """The weight of a body whose undeformed mesh bears no load.

    A breast in a prone MR scan hangs under its weight already: gravity towards the table, taken away, and gravity
    across it, added, are two loads, of which this is one.

    Args:
        model: the body.
        density_kg_m3: scalar or one per element (E,); breast tissue has about 1000.
        direction: (3,) in the frame of the body's points, the way in which things fall; any length but zero.

    Raises:
        ValueError: the direction has no length, or a density is negative.
    """
    down = np.asarray(direction, dtype=float)
    length = float(np.linalg.norm(down))
    if not length > 0.0:
        raise ValueError("the direction of gravity has no length")
    density = np.broadcast_to(np.asarray(density_kg_m3, dtype=float), (len(model.hexes),))
    if np.any(density < 0.0):
        raise ValueError("a density is negative")
    weight = np.zeros(len(model.points))
    np.add.at(weight, model.hexes, density[:, None] * _corner_volumes(model))
    force = (_MN_PER_SI * STANDARD_GRAVITY) * weight[:, None] * (down / length)
    return Gravity(force, model.points)


def _corner_volumes(model: HyperelasticModel) -> Floats:
    """Integrals (E, 8), mm3, of the shape functions of each element."""
    basis = skfem_basis(model.points, model.hexes)
    volumes = np.empty((len(model.hexes), 8))
    for corner, vtk in enumerate(VTK_IN_SKFEM):
        volumes[:, vtk] = (np.array(basis.basis[corner][0]) * np.array(basis.dx)).sum(axis=1)
    return volumes
