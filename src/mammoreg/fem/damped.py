"""Newton's method on a damped equilibrium: implicit steps of a gradient flow that passes instabilities.

A tall breast between plates can tip over or snap; then no Newton iteration from the last load step finds the next
equilibrium. Each step therefore adds damping * (u - u0): with damping the problem is close to convex, and as the
steps are repeated with less of it the static equilibrium remains.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftMemory, SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.parts import Part, Parts, all_nodes, back_springs, parts_at
from mammoreg.fem.sparse import Array, Integers
from mammoreg.fem.system import NewtonSystem, node_dofs

LEAST_DET_SHARE = 0.2  # a Newton step may shrink the smallest det F to this share of itself
RUNAWAY_MM = 200.0
ITERATIONS = 14


@dataclass(frozen=True)
class DampedState:
    """A deformation.

    Attributes:
        positions: nodes (N, 3), extra ones behind the body's, mm.
        pressure: element pressures (E,), kPa.
        height: the plates' extra height, mm.
        memory: of the contact.
        parts: as they were renewed here; None: as the equilibrium has them at first.
    """

    positions: Array
    pressure: Array
    height: float
    memory: SoftMemory
    parts: Parts | None = None


@dataclass(frozen=True)
class Load:
    """What a step loads: plates (lower, upper), and the share of the back's pull and of gradual parts."""

    plates: tuple[Plate, Plate]
    share: float = 1.0


class DampedEquilibrium:
    """A body held at its back, in soft contact with plates, with further parts.

    Args:
        model: the body in the plate frame.
        back: its back's condition; may name extra nodes.
        contact: its contact.
        free_height: whether the plates' common height is an unknown.
        parts: what else acts.
        extra_nodes: undeformed nodes (M, 3) beside the body's, mm, numbered behind them.

    Attributes:
        points: all undeformed nodes.
        held: their prescribed components.
        residuals: residual ratio of each Newton iteration so far.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        back: BackCondition,
        contact: SoftContact,
        *,
        free_height: bool,
        parts: Sequence[Part] = (),
        extra_nodes: Array | None = None,
    ) -> None:
        self.model, self.back, self.contact = model, back, contact
        self.points = all_nodes(model.points, extra_nodes)
        self.springs, self.parts = back_springs(back, self.points), tuple(parts)
        self.total = self.points.size + 1
        self.held = np.zeros(self.points.shape, dtype=bool)
        self.held[back.nodes] = back.held
        self.free: Integers = np.flatnonzero(np.append(~self.held.ravel(), free_height))
        self.weight = self._weight()
        self.residuals: list[float] = []
        self._prepare(self.parts)

    def with_contact(self, contact: SoftContact) -> "DampedEquilibrium":
        """The same equations and record with another contact of the same faces."""
        other = copy(self)
        other.contact = contact
        return other

    def anchors(self, share: float) -> Array:
        """Where held components (N, 3) stand at a share of the pull."""
        anchors = self.points.copy()
        anchors[self.back.nodes] += share * self.back.pull_mm
        return anchors

    def _prepare(self, parts: Parts) -> None:
        """The linear system for the degrees of freedom of parts."""
        faces = node_dofs(self.contact.surface.quads)
        with_height = np.hstack([faces, np.full((len(faces), 1), self.total - 1)])
        every = np.arange(self.total)[:, None]
        groups = [*(s.dofs for s in self.springs), with_height, every, *(part.dofs for part in parts)]
        self.system = NewtonSystem(self.model, groups, self.free, self.total)
        self._prepared = parts

    def _fit(self, parts: Parts) -> None:
        """Prepare the system anew where parts have other degrees of freedom than it was made for."""
        same = len(parts) == len(self._prepared) and all(
            new is old or np.array_equal(new.dofs, old.dofs) for new, old in zip(parts, self._prepared, strict=True)
        )
        if same:
            self._prepared = parts
        else:
            self._prepare(parts)

    def _weight(self) -> Array:
        """Damping (total,) per unit of the damping factor, mN/mm: mu times the node's share of volume over h^2."""
        volume = np.bincount(self.model.hexes.ravel(), weights=np.repeat(self.model.volume / 8.0, 8))
        mu = float(np.average(self.model.material.mu_kpa, weights=self.model.volume))
        size = float(np.mean(self.model.volume)) ** (1.0 / 3.0)
        body, extra = self.points[: len(volume)], self.points[len(volume) :]
        share = np.append(volume, volume[cKDTree(body).query(extra)[1]])
        return np.asarray(np.append(np.repeat(share, 3), volume.sum()) * mu / size**2)

    def step(self, start: DampedState, load: Load, damping: float, tolerance_mm: float) -> DampedState:
        """One implicit step, damped towards its start.

        Args:
            start: deformation to start from; held components must stand at their targets.
            load: plates, and how far the other loads are on.
            damping: factor of the damping.
            tolerance_mm: the iteration ends at updates below this.

        Raises:
            NotConvergedError: elements turn inside out, or the updates do not become small.
        """
        state = start
        lagged = self.parts if start.parts is None else start.parts
        self._fit(lagged)
        acting = parts_at((*self.springs, *lagged), load.share)
        for _ in range(ITERATIONS):
            update, pressure = self._newton(state, start, load.plates, acting, damping)
            state, moved = self._moved(state, update, pressure)
            if moved < tolerance_mm:
                terms = self.terms(state, load.plates)
                memory = self.contact.remember(state.positions, load.plates, state.height, terms)
                return replace(state, memory=memory, parts=tuple(part.renewed(state.positions) for part in lagged))
        raise NotConvergedError(f"no equilibrium within {ITERATIONS} Newton iterations")

    def terms(self, state: DampedState, plates: Sequence[Plate]) -> SoftTerms:
        """Contact at a state."""
        return self.contact.terms(state.positions, state.height, plates, state.memory)

    def _newton(
        self, state: DampedState, start: DampedState, plates: Sequence[Plate], acting: Parts, damping: float
    ) -> tuple[Array, Array]:
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        contact = self.terms(state, plates)
        moved = np.append((state.positions - start.positions).ravel(), state.height - start.height)
        pairs = [part.terms(state.positions) for part in acting]
        springs, others = pairs[: len(self.springs)], pairs[len(self.springs) :]
        tangent = self.model.stiffness(elements, state.pressure, internal.coupling)
        damped = (damping * self.weight * moved)[:, None], (damping * self.weight)[:, None, None]
        groups = [(internal.force, tangent), *springs, (contact.force, contact.stiffness), damped, *others]
        vectors, blocks = [vector for vector, _ in groups], [block for _, block in groups]
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
