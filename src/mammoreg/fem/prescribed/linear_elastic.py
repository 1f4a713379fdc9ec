"""Small strains of a body: a linear problem, assembled and factorised once for all of its loads.

The tangent of the hyperelastic body at rest is that of linear elasticity with its initial shear modulus and its bulk
modulus, with one pressure for each element.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.direct import linear_solver
from mammoreg.fem.linear.sparse import Assembler


@dataclass(frozen=True)
class SmallStrain:
    """A loaded body.

    Attributes:
        displacement: of the nodes (N, 3), mm.
        pressure: of the elements (E,), kPa, positive in tension.
        reaction: forces (N, 3) at held components, mN; zero elsewhere.
    """

    displacement: Floats
    pressure: Floats
    reaction: Floats


class LinearElasticBody:
    """A body whose held components are prescribed.

    Args:
        model: the body; its undeformed state is linearised.
        held: prescribed components (N, 3).
    """

    def __init__(self, model: HyperelasticModel, held: NDArray[np.bool_]) -> None:
        self.model, self.held = model, held
        at_rest, none = model.state(model.points), np.zeros(len(model.hexes))
        self._coupling = model.residual(at_rest, none).coupling
        self._blocks = model.stiffness(at_rest, none, self._coupling)
        self._free = np.flatnonzero(~held.ravel())
        assembler = Assembler([model.dofs], self._free, held.size, symmetric=True)
        self._solver = linear_solver(assembler.indptr, assembler.indices, symmetric=True)
        self._solver.factorise(assembler.values([self._blocks]))

    @property
    def factorisations(self) -> int:
        """So far: one, however many loads are solved."""
        return self._solver.factorisations

    def solve(self, prescribed: Floats | None = None, force: Floats | None = None) -> SmallStrain:
        """Displacements under a load.

        Args:
            prescribed: displacements (N, 3), mm, of the held components; default zero.
            force: on the nodes (N, 3), mN; default none.

        Raises:
            NotConvergedError: the body is not held enough.
        """
        displacement = np.zeros(self.held.size)
        if prescribed is not None:
            displacement = np.where(self.held, prescribed, 0.0).ravel()
        load = np.zeros(self.held.size) if force is None else force.ravel()
        rhs = load - self._product(displacement)
        displacement[self._free] = self._solver.back_substitute(rhs[self._free])
        reaction = np.where(self.held.ravel(), self._product(displacement) - load, 0.0)
        dilatation = np.einsum("ei,ei->e", self._coupling, displacement[self.model.dofs])
        pressure = self.model.bulk_per_volume * dilatation
        return SmallStrain(displacement.reshape(-1, 3), pressure, reaction.reshape(-1, 3))

    def _product(self, displacement: Floats) -> Floats:
        """Stiffness times displacements (3 N,)."""
        forces = np.einsum("eij,ej->ei", self._blocks, displacement[self.model.dofs])
        return np.asarray(np.bincount(self.model.dofs.ravel(), forces.ravel(), displacement.size), dtype=float)
