"""Newton's method on a damped equilibrium: implicit steps of a gradient flow that passes instabilities.

A tall breast between plates can tip over or snap; then no Newton iteration from the last load step finds the next
equilibrium. Each step therefore adds damping * (u - u0): with damping the problem is close to convex, and as the
steps are repeated with less of it the static equilibrium remains.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.system import NewtonSystem, node_dofs
from mammoreg.fem.parts.back import BackCondition
from mammoreg.fem.parts.part import Part, Parts, all_nodes, back_springs, parts_at
from mammoreg.fem.plates.newton import DampedStep
from mammoreg.fem.plates.state import DampedState, Load
from mammoreg.fem.report import Stopwatch


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
        watch: where the time goes.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        back: BackCondition,
        contact: SoftContact,
        *,
        free_height: bool,
        parts: Sequence[Part] = (),
        extra_nodes: Floats | None = None,
    ) -> None:
        self.model, self.back, self.contact = model, back, contact
        self.points = all_nodes(model.points, extra_nodes)
        self.springs: Parts = back_springs(back, self.points)
        self.parts = tuple(parts)
        self.total = self.points.size + 1
        self.held = np.zeros(self.points.shape, dtype=bool)
        self.held[back.nodes] = back.held
        self.free: Integers = np.flatnonzero(np.append(~self.held.ravel(), free_height))
        self.weight = self._weight()
        self.residuals: list[float] = []
        self.watch = Stopwatch()
        self._prepare(self.parts)

    def with_contact(self, contact: SoftContact) -> "DampedEquilibrium":
        """The same equations and record with another contact of the same faces."""
        other = copy(self)
        other.contact = contact
        return other

    def anchors(self, load_factor: float) -> Floats:
        """Where held components (N, 3) stand at a load factor of the pull."""
        anchors = self.points.copy()
        anchors[self.back.nodes] += load_factor * self.back.pull_mm
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

    def _weight(self) -> Floats:
        """Damping (total,) per unit of the damping factor, mN/mm: mu times the node's share of volume over h^2."""
        volume = np.bincount(self.model.hexes.ravel(), weights=np.repeat(self.model.volume / 8.0, 8))
        mu = self.model.mean_mu_kpa
        size = float(np.mean(self.model.volume)) ** (1.0 / 3.0)
        body, extra = self.points[: len(volume)], self.points[len(volume) :]
        lumped = np.append(volume, volume[cKDTree(body).query(extra)[1]])
        return np.asarray(np.append(np.repeat(lumped, 3), volume.sum()) * mu / size**2)

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
        state, reason = self.approach(start, load, damping, tolerance_mm)
        if reason:
            raise NotConvergedError(reason)
        return state

    def approach(self, start: DampedState, load: Load, damping: float, tolerance_mm: float) -> tuple[DampedState, str]:
        """As `step`, but a state nearer to the step's equilibrium is returned too, with what keeps it from being one.

        Raises:
            NotConvergedError: elements turn inside out.
        """
        lagged = self.parts if start.parts is None else start.parts
        step = self._step(start, load, damping)
        state, reason = step.solve(tolerance_mm)
        terms = self.terms(state, load.plates)
        memory = self.contact.remember(state.positions, load.plates, state.height, terms, start.memory)
        parts = tuple(part.renewed(state.positions) for part in lagged)
        return replace(state, memory=memory, parts=parts), reason

    def unbalance(self, state: DampedState, load: Load) -> float:
        """Ratio of unbalanced to internal forces at a state, without damping."""
        return self._step(state, load, 0.0).unbalance(state)

    def _step(self, start: DampedState, load: Load, damping: float) -> DampedStep:
        lagged = self.parts if start.parts is None else start.parts
        self._fit(lagged)
        return DampedStep(self, start, load, parts_at((*self.springs, *lagged), load.factor), damping)

    def penetration_mm(self, state: DampedState, plates: Sequence[Plate]) -> float:
        """How deep skin lies in a plate that could give way: faces whose height is held somewhere are left out."""
        free = ~self.held[self.contact.surface.quads, 2].any(axis=1)
        points = self.contact.points(state.positions, state.height)[free].reshape(-1, 3)
        return max(0.0, *(-float(plate.gap(points).distance.min(initial=0.0)) for plate in plates))

    def terms(self, state: DampedState, plates: Sequence[Plate]) -> SoftTerms:
        """Contact at a state."""
        return self.contact.terms(state.positions, state.height, plates, state.memory)
