"""Newton iteration of a body whose held components are prescribed; its back may stand on springs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel, Residual
from mammoreg.fem.linear.system import NewtonSystem
from mammoreg.fem.parts.back import BackCondition
from mammoreg.fem.parts.part import Part, Parts, all_nodes, back_springs, parts_at
from mammoreg.fem.report import Stopwatch

LEAST_DET_RATIO = 0.1
NEGLIGIBLE = 1e-6  # of the largest last displacement


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
class PrescribedState:
    """A deformation: nodes (N, 3), mm, extra ones behind the body's, and element pressures (E,), kPa."""

    positions: Floats
    pressure: Floats


class Equilibrium:
    """The equations of a body without contact.

    Args:
        model: the body.
        held: prescribed components (N, 3), extra nodes included.
        back: springs of the back (its held components are not looked at here).
        parts: what else acts.
        extra_nodes: undeformed nodes (M, 3) beside the body's, mm, numbered behind them.

    Attributes:
        parts: as renewed after the last solve.
        residuals: residual ratio of every iteration so far.
        watch: where the time goes.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        held: NDArray[np.bool_],
        back: BackCondition | None = None,
        parts: Sequence[Part] = (),
        extra_nodes: Floats | None = None,
    ) -> None:
        self.model, self.held = model, held
        self.parts: Parts = (*back_springs(back, all_nodes(model.points, extra_nodes)), *parts)
        self.residuals: list[float] = []
        self.watch = Stopwatch()
        self.system = self._system()

    def _system(self) -> NewtonSystem:
        groups = [part.dofs for part in self.parts]
        return NewtonSystem(self.model, groups, np.flatnonzero(~self.held.ravel()), self.held.size)

    def solve(
        self, start: PrescribedState, targets: Floats, options: NewtonOptions, load_factor: float = 1.0
    ) -> PrescribedState:
        """Find the equilibrium whose held components stand at their targets (N, 3), mm; then renew the parts.

        Args:
            start: where to begin.
            targets: places of the held components.
            options: when the iteration ends.
            load_factor: of the load of gradual parts.

        Raises:
            NotConvergedError: no equilibrium within the iterations, or elements turn inside out.
        """
        state, last = start, np.inf
        acting = parts_at(self.parts, load_factor)
        pending = np.where(self.held, targets - start.positions, 0.0).ravel()
        imposed: Floats | None = pending if pending.any() else None
        for _ in range(options.iterations):
            with self.watch.timing("assembly"):
                internal, vectors, blocks = self._terms(state, acting)
            volume = float(np.abs(internal.volume / self.model.volume).max())
            ratio = max(self.system.unbalance(vectors), volume)
            self.residuals.append(ratio)
            # Without any strain forces are rounding errors, and so is their balance.
            balanced = ratio < options.residual or last < NEGLIGIBLE * options.increment_mm
            if imposed is None and balanced and last < options.increment_mm:
                self._renew(state)
                return state
            with self.watch.timing("linear"):
                update, pressure = self.system.increment(internal, vectors, blocks, imposed)
            admissible = self.system.admissible(state.positions, update, LEAST_DET_RATIO)
            if imposed is not None and admissible < 1.0:
                raise NotConvergedError("an element turns inside out")
            positions = state.positions + admissible * update.reshape(-1, 3)
            state, imposed = PrescribedState(positions, state.pressure + admissible * pressure), None
            last = admissible * float(np.abs(update).max())
        raise NotConvergedError(f"no equilibrium within {options.iterations} Newton iterations (residual {ratio:.1e})")

    def reaction(self, state: PrescribedState, load_factor: float = 1.0) -> Floats:
        """Force (N, 3) in mN that holds the nodes in a state."""
        return self.system.sum(self._terms(state, parts_at(self.parts, load_factor))[1]).reshape(-1, 3)

    def unbalance(self, state: PrescribedState) -> float:
        """Ratio of unbalanced to internal forces at a state under the whole load."""
        return self.system.unbalance(self._terms(state, self.parts)[1])

    def _renew(self, state: PrescribedState) -> None:
        before, self.parts = self.parts, tuple(part.renewed(state.positions) for part in self.parts)
        if any(
            new is not old and not np.array_equal(new.dofs, old.dofs)
            for new, old in zip(self.parts, before, strict=True)
        ):
            self.system = self._system()

    def _terms(self, state: PrescribedState, acting: Parts) -> tuple[Residual, list[Floats], list[Floats]]:
        """The elements' residual, and residual and tangent of each group."""
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        tangent = self.model.stiffness(elements, state.pressure, internal.coupling)
        pairs = [(internal.force, tangent), *(part.terms(state.positions) for part in acting)]
        return internal, [vector for vector, _ in pairs], [block for _, block in pairs]
