"""Newton's method on a damped equilibrium: implicit steps of a gradient flow that passes instabilities.

A tall breast between plates can tip over or snap; then no Newton iteration from the last load step finds the next
equilibrium. Each step therefore adds damping * (u - u0): with damping the problem is close to convex, and as the
steps are repeated with less of it the static equilibrium remains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftMemory, SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.linear import linear_solver
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.sparse import Array, Assembler, Integers
from mammoreg.fem.ties import PlaneTies

LEAST_DET_SHARE = 0.2  # a Newton step may shrink the smallest det F to this share of itself
LEAST_STEP = 0.05
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
        iterations: Newton iterations so far.
        residuals: residual ratio of each.
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
        self.free: Integers = np.flatnonzero(np.append(~self.held.ravel(), free_height))
        self.groups = self._groups()
        self.assembler = Assembler(self.groups, self.free, self.total, symmetric=True)
        self.solver = linear_solver(self.assembler.indptr, self.assembler.indices, True)
        self.weight = self._weight()
        self.iterations, self.residuals = 0, list[float]()

    def _groups(self) -> list[Integers]:
        faces = _dofs(self.contact.surface.quads)
        with_height = np.hstack([faces, np.full((len(faces), 1), self.total - 1)])
        every = np.arange(self.total)[:, None]
        groups = [self.model.dofs, _dofs(self.back.nodes[:, None]), with_height, every]
        return groups if self.ties is None else [*groups, _dofs(self.ties.nodes)]

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
        residual = self._sum(vectors)
        scale = float(np.linalg.norm(self._sum([np.abs(v) for v in vectors])))
        self.residuals.append(float(np.linalg.norm(residual[self.free])) / max(scale, 1e-12))
        rate = self.model.bulk_per_volume
        correction = (rate * internal.volume)[:, None] * internal.coupling
        residual += np.bincount(self.model.dofs.ravel(), weights=correction.ravel(), minlength=self.total)
        update = np.zeros(self.total)
        update[self.free] = self.solver.solve(self.assembler.values(blocks), -residual[self.free])
        self.iterations += 1
        along = np.einsum("ei,ei->e", internal.coupling, update[self.model.dofs])
        return update, np.asarray(rate * (internal.volume + along))

    def _sum(self, vectors: list[Array]) -> Array:
        index = np.concatenate([group.ravel() for group in self.groups])
        return np.bincount(index, weights=np.concatenate([v.ravel() for v in vectors]), minlength=self.total)

    def _moved(self, state: DampedState, update: Array, pressure: Array) -> tuple[DampedState, float]:
        """The state after an update, halved until no element collapses, and the largest displacement."""
        largest = float(np.abs(update).max())
        if not np.isfinite(largest) or largest > RUNAWAY_MM:
            raise NotConvergedError("the Newton iteration runs away")
        motion = update[:-1].reshape(-1, 3)
        least = LEAST_DET_SHARE * self.model.determinants(state.positions).min()
        share = 1.0
        while self.model.determinants(state.positions + share * motion).min() < least:
            share *= 0.5
            if share < LEAST_STEP:
                raise NotConvergedError("an element turns inside out")
        moved = replace(
            state,
            positions=state.positions + share * motion,
            pressure=state.pressure + share * pressure,
            height=state.height + share * float(update[-1]),
        )
        return moved, share * largest


def _dofs(nodes: Integers) -> Integers:
    """Degrees of freedom (M, 3 k) of nodes (M, k)."""
    return np.asarray((3 * np.asarray(nodes)[:, :, None] + np.arange(3)).reshape(len(nodes), -1))
