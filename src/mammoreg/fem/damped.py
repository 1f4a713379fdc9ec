"""Newton's method on a damped equilibrium: implicit steps of a gradient flow that passes instabilities.

A tall breast between plates can tip over or snap; then no Newton iteration from the last load step finds the next
equilibrium. Each step therefore adds damping * (u - u0): with damping the problem is close to convex, and as the
steps are repeated with less of it the static equilibrium remains.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftMemory, SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.sparse import Array, Integers
from mammoreg.fem.system import NewtonSystem, node_dofs
from mammoreg.fem.ties import PlaneTies

LEAST_DET_SHARE = 0.2  # a Newton step may shrink the smallest det F to this share of itself
RUNAWAY_MM = 200.0
ITERATIONS = 14


@dataclass(frozen=True)
class DampedState:
    """A deformation: nodes (N, 3) mm, element pressures (E,) kPa, the plates' extra height mm, contact memory."""

    positions: Array
    pressure: Array
    height: float
    memory: SoftMemory


class DampedEquilibrium:
    """A breast held at its back, in soft contact with plates, optionally tied to an outline.

    Args:
        model: the body in the plate frame.
        back: its back's condition.
        contact: its contact.
        free_height: whether the plates' common height is an unknown.
        ties: springs towards an outline.

    Attributes:
        residuals: residual ratio of each Newton iteration so far.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        back: BackCondition,
        contact: SoftContact,
        *,
        free_height: bool,
        ties: PlaneTies | None = None,
    ) -> None:
        self.model, self.back, self.contact, self.ties = model, back, contact, ties
        count = len(model.points)
        self.total = 3 * count + 1
        self.held = np.zeros((count, 3), dtype=bool)
        self.held[back.nodes] = back.held
        free: Integers = np.flatnonzero(np.append(~self.held.ravel(), free_height))
        self.system = NewtonSystem(model, self._groups(), free, self.total)
        self.weight = self._weight()
        self.residuals: list[float] = []

    def with_contact(self, contact: SoftContact) -> "DampedEquilibrium":
        """The same equations and record with another contact of the same faces."""
        other = copy(self)
        other.contact = contact
        return other

    def _groups(self) -> list[Integers]:
        """Degrees of freedom of springs, contact, damping and ties."""
        faces = node_dofs(self.contact.surface.quads)
        with_height = np.hstack([faces, np.full((len(faces), 1), self.total - 1)])
        every = np.arange(self.total)[:, None]
        groups = [node_dofs(self.back.nodes[:, None]), with_height, every]
        return groups if self.ties is None else [*groups, node_dofs(self.ties.nodes)]

    def _weight(self) -> Array:
        """Damping (total,) per unit of the damping factor, mN/mm: mu times the node's share of volume over h^2."""
        volume = np.bincount(self.model.hexes.ravel(), weights=np.repeat(self.model.volume / 8.0, 8))
        mu = float(np.average(self.model.material.mu_kpa, weights=self.model.volume))
        size = float(np.mean(self.model.volume)) ** (1.0 / 3.0)
        return np.asarray(np.append(np.repeat(volume, 3), volume.sum()) * mu / size**2)

    def step(
        self, start: DampedState, plates: Sequence[Plate], anchors: Array, damping: float, tolerance_mm: float
    ) -> DampedState:
        """One implicit step, damped towards its start.

        Args:
            start: deformation to start from; held components must stand at their targets.
            plates: lower and upper.
            anchors: places (N, 3) of the back's springs.
            damping: factor of the damping.
            tolerance_mm: the iteration ends at updates below this.

        Raises:
            NotConvergedError: elements turn inside out, or the updates do not become small.
        """
        state = start
        for _ in range(ITERATIONS):
            update, pressure = self._newton(state, start, plates, anchors, damping)
            state, moved = self._moved(state, update, pressure)
            if moved < tolerance_mm:
                terms = self.terms(state, plates)
                memory = self.contact.remember(state.positions, plates, state.height, terms)
                return replace(state, memory=memory)
        raise NotConvergedError(f"no equilibrium within {ITERATIONS} Newton iterations")

    def terms(self, state: DampedState, plates: Sequence[Plate]) -> SoftTerms:
        """Contact at a state."""
        return self.contact.terms(state.positions, state.height, plates, state.memory)

    def _newton(
        self, state: DampedState, start: DampedState, plates: Sequence[Plate], anchors: Array, damping: float
    ) -> tuple[Array, Array]:
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        contact = self.terms(state, plates)
        stretch = state.positions[self.back.nodes] - anchors[self.back.nodes]
        moved = np.append((state.positions - start.positions).ravel(), state.height - start.height)
        vectors = [
            internal.force,
            np.einsum("bij,bj->bi", self.back.springs, stretch),
            contact.force,
            (damping * self.weight * moved)[:, None],
        ]
        blocks = [
            self.model.stiffness(elements, state.pressure, internal.coupling),
            self.back.springs,
            contact.stiffness,
            (damping * self.weight)[:, None, None],
        ]
        if self.ties is not None:
            vectors.append(self.ties.force(state.positions))
            blocks.append(self.ties.blocks())
        self.residuals.append(self.system.unbalance(vectors))
        return self.system.increment(internal, vectors, blocks)

    def _moved(self, state: DampedState, update: Array, pressure: Array) -> tuple[DampedState, float]:
        """The state after an update, halved until no element collapses, and how far the whole update would go."""
        largest = float(np.abs(update).max())
        if largest > RUNAWAY_MM:
            raise NotConvergedError("the Newton iteration runs away")
        share = self.system.admissible(state.positions, update, LEAST_DET_SHARE)
        moved = replace(
            state,
            positions=state.positions + share * update[:-1].reshape(-1, 3),
            pressure=state.pressure + share * pressure,
            height=state.height + share * float(update[-1]),
        )
        return moved, largest
