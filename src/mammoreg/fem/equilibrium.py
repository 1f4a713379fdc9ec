"""Newton iteration of a body whose held components are prescribed; its back may stand on springs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.model import HyperelasticModel, Residual
from mammoreg.fem.sparse import Array
from mammoreg.fem.system import NewtonSystem, node_dofs

LEAST_DET_SHARE = 0.1


@dataclass(frozen=True)
class NewtonOptions:
    """When an iteration ends.

    Attributes:
        residual: largest ratio of the unbalanced to the internal forces.
        increment_mm: largest last displacement.
        iterations: at most.
    """

    residual: float = 1e-4
    increment_mm: float = 0.02
    iterations: int = 20


@dataclass(frozen=True)
class State:
    """A deformation: nodes (N, 3), mm, and element pressures (E,), kPa."""

    positions: Array
    pressure: Array


class Equilibrium:
    """The equations of a body without contact.

    Args:
        model: the body.
        held: prescribed components (N, 3).
        back: springs of the back (its held components are not looked at here).

    Attributes:
        residuals: residual ratio of every iteration so far.
    """

    def __init__(self, model: HyperelasticModel, held: NDArray[np.bool_], back: BackCondition | None = None) -> None:
        self.model, self.held = model, held
        self.back = back if back is not None and back.springs.any() else None
        groups = [] if self.back is None else [node_dofs(self.back.nodes[:, None])]
        self.system = NewtonSystem(model, groups, np.flatnonzero(~held.ravel()), held.size)
        self.residuals: list[float] = []

    def solve(self, start: State, targets: Array, options: NewtonOptions) -> State:
        """Find the equilibrium whose held components stand at their targets (N, 3), mm.

        Raises:
            NotConvergedError: no equilibrium within the iterations, or elements turn inside out.
        """
        state, last = start, np.inf
        pending = np.where(self.held, targets - start.positions, 0.0).ravel()
        imposed: Array | None = pending if pending.any() else None
        for _ in range(options.iterations):
            internal, vectors, blocks = self._terms(state)
            volume = float(np.abs(internal.volume / self.model.volume).max())
            ratio = max(self.system.unbalance(vectors), volume)
            self.residuals.append(ratio)
            if imposed is None and ratio < options.residual and last < options.increment_mm:
                return state
            update, pressure = self.system.increment(internal, vectors, blocks, imposed)
            share = self.system.admissible(state.positions, update, LEAST_DET_SHARE)
            if imposed is not None and share < 1.0:
                raise NotConvergedError("an element turns inside out")
            positions = state.positions + share * update.reshape(-1, 3)
            state, imposed = State(positions, state.pressure + share * pressure), None
            last = share * float(np.abs(update).max())
        raise NotConvergedError(f"no equilibrium within {options.iterations} Newton iterations (residual {ratio:.1e})")

    def reaction(self, state: State) -> Array:
        """Force (N, 3) in mN that holds the nodes in a state."""
        return self.system.sum(self._terms(state)[1]).reshape(-1, 3)

    def _terms(self, state: State) -> tuple[Residual, list[Array], list[Array]]:
        """The elements' residual, and residual and tangent of each group."""
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        vectors, blocks = [internal.force], [self.model.stiffness(elements, state.pressure, internal.coupling)]
        if self.back is not None:
            anchors = self.model.points[self.back.nodes] + self.back.pull_mm
            stretch = state.positions[self.back.nodes] - anchors
            vectors.append(np.einsum("bij,bj->bi", self.back.springs, stretch))
            blocks.append(self.back.springs)
        return internal, vectors, blocks
