"""Newton iteration of a body, its supports and its contact at one load."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.augmented import ContactState, ContactTerms, PlateContact
from mammoreg.contact.plate import Plate
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.linear import linear_solver
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.sparse import Array, Assembler, Integers


@dataclass(frozen=True)
class NewtonOptions:
    """When an iteration ends.

    Attributes:
        residual: largest ratio of the unbalanced to the internal forces.
        increment_mm: largest last displacement.
        contact_mm: largest penetration of a contact point.
        iterations: at most.
        augment_below: multipliers are updated once the residual ratio is below this.
        least_det: a step is shortened until det F is at least this share of its last value.
    """

    residual: float = 1e-4
    increment_mm: float = 0.02
    contact_mm: float = 0.1
    iterations: int = 25
    augment_below: float = 0.02
    least_det: float = 0.1


@dataclass(frozen=True)
class State:
    """A deformation: nodes (N, 3) mm, pressures (E,) kPa, the plates' extra height mm, contact memory."""

    positions: Array
    pressure: Array
    height: float = 0.0
    contact: ContactState | None = None


@dataclass(frozen=True)
class Load:
    """What a load step prescribes: plates, and positions (N, 3) whose held components count."""

    plates: Sequence[Plate]
    targets: Array
    anchors: Array


@dataclass
class Record:
    """What happened: residual ratio of every Newton iteration, and of the last linear system the negative pivots."""

    residuals: list[float] = field(default_factory=list)
    negative_eigenvalues: int | None = None


@dataclass(frozen=True)
class Forces:
    """Everything evaluated at one state."""

    blocks: list[Array]
    residual: Array
    scale: float
    volume: Array
    coupling: Array
    contact: ContactTerms | None


class Equilibrium:
    """The equations of a body with held components, springs and contact.

    Args:
        model: the body.
        held: prescribed components (N, 3).
        back: springs of the back (its held components are not looked at here).
        contact: contact with plates, or None.
        free_height: whether the plates' common height is an unknown.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        held: NDArray[np.bool_],
        back: BackCondition | None = None,
        contact: PlateContact | None = None,
        free_height: bool = False,
    ) -> None:
        self.model, self.held, self.contact = model, held, contact
        self.back = back if back is not None and back.springs.any() else None
        self.total = 3 * len(model.points) + 1
        self.free: Integers = np.flatnonzero(np.append(~held.ravel(), free_height))
        self.groups = self._groups()
        symmetric = contact is None or contact.friction == 0.0
        self.assembler = Assembler(self.groups, self.free, self.total, symmetric)
        self.solver = linear_solver(self.assembler.indptr, self.assembler.indices, symmetric)

    def _groups(self) -> list[Integers]:
        """Degrees of freedom of the blocks: elements, then springs, then faces with the height."""
        groups = [self.model.dofs]
        if self.back is not None:
            groups.append(_node_dofs(self.back.nodes[:, None]))
        if self.contact is not None:
            faces = _node_dofs(self.contact.surface.quads)
            groups.append(np.hstack([faces, np.full((len(faces), 1), self.total - 1)]))
        return groups

    def forces(self, state: State, load: Load) -> Forces:
        """Residual and tangent blocks at a state with det F > 0."""
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        stiffness = self.model.stiffness(elements, state.pressure, internal.coupling)
        vectors, blocks, contact = [internal.force], [stiffness], None
        if self.back is not None:
            stretch = state.positions[self.back.nodes] - load.anchors[self.back.nodes]
            vectors.append(np.einsum("bij,bj->bi", self.back.springs, stretch))
            blocks.append(self.back.springs)
        if self.contact is not None and state.contact is not None:
            contact = self.contact.terms(state.positions, state.height, load.plates, state.contact)
            vectors.append(contact.force)
            blocks.append(contact.stiffness)
        scale = float(np.linalg.norm(self._sum([np.abs(v) for v in vectors])))
        return Forces(blocks, self._sum(vectors), scale, internal.volume, internal.coupling, contact)

    def _sum(self, vectors: list[Array]) -> Array:
        """Assemble block vectors over all degrees of freedom."""
        index = np.concatenate([group.ravel() for group in self.groups])
        flat = np.concatenate([v.ravel() for v in vectors])
        return np.asarray(np.bincount(index, weights=flat, minlength=self.total), dtype=float)

    def solve(self, start: State, load: Load, options: NewtonOptions, record: Record) -> State:
        """Newton iteration from a start to equilibrium; held components move to their targets in the first step.

        Raises:
            NotConvergedError: no equilibrium within the iterations, or elements turn inside out.
        """
        state, last = start, np.inf
        pending = np.append(np.where(self.held, load.targets - start.positions, 0.0).ravel(), 0.0)
        for _ in range(options.iterations):
            forces = self.forces(state, load)
            ratio = self._unbalance(forces, pending)
            record.residuals.append(ratio)
            violation = self._violation(forces, state)
            if ratio < options.residual and last < options.increment_mm and violation < options.contact_mm:
                return state
            if not np.isfinite(ratio):
                break
            if ratio < options.augment_below and violation >= options.contact_mm:
                state = self._augmented(state, forces)
                forces = self.forces(state, load)
            state, last = self._step(state, forces, pending, options)
            record.negative_eigenvalues = self.solver.negative_eigenvalues
            pending = np.zeros(self.total)
        worst = record.residuals[-1]
        raise NotConvergedError(f"no equilibrium within {options.iterations} Newton iterations (residual {worst:.1e})")

    def _augmented(self, state: State, forces: Forces) -> State:
        """The state with multipliers equal to the present contact pressures and a stiffer penalty."""
        if self.contact is None or state.contact is None or forces.contact is None:
            return state
        penalty = min(state.contact.penalty * self.contact.growth, self.contact.stiffest)
        multiplier = np.where(forces.contact.flat, forces.contact.pressure, state.contact.multiplier)
        memory = replace(state.contact, multiplier=multiplier, penalty=penalty)
        return replace(state, contact=memory)

    def _unbalance(self, forces: Forces, pending: Array) -> float:
        """Ratio of unbalanced to internal forces; large while displacements are pending."""
        if np.abs(pending).max() > 0.0:
            return 1.0
        volume = float(np.abs(forces.volume / self.model.volume).max())
        floor = 1e-9 * float((self.model.material.mu_kpa * self.model.volume ** (2.0 / 3.0)).sum())
        return max(float(np.linalg.norm(forces.residual[self.free])) / max(forces.scale, floor), volume)

    def _violation(self, forces: Forces, state: State) -> float:
        """Largest distance, mm, by which a contact point misses its plate (penetration or leftover multiplier)."""
        if self.contact is None or forces.contact is None or state.contact is None:
            return 0.0
        if state.contact.penalty < self.contact.stiffest:
            return float("inf")
        excess = np.abs(forces.contact.pressure - state.contact.multiplier)
        return float(np.where(forces.contact.flat, excess, 0.0).max()) / state.contact.penalty

    def _step(self, state: State, forces: Forces, pending: Array, options: NewtonOptions) -> tuple[State, float]:
        """One linear solve; the update is shortened until no element collapses."""
        pressure_rate = self.model.bulk_per_volume
        correction = (pressure_rate * forces.volume)[:, None] * forces.coupling
        residual = forces.residual + self._sum([correction, *self._nothing()])
        if pending.any():
            products = [np.einsum("bij,bj->bi", b, pending[g]) for b, g in zip(forces.blocks, self.groups, strict=True)]
            residual += self._sum(products)
        update = pending.copy()
        update[self.free] = self.solver.solve(self.assembler.values(forces.blocks), -residual[self.free])
        if not np.isfinite(update).all():
            raise NotConvergedError("the linear system has no finite solution")
        along = np.einsum("ei,ei->e", forces.coupling, update[self.model.dofs])
        pressure = pressure_rate * (forces.volume + along)
        share = self._admissible(state, update, 1.0 if pending.any() else options.least_det)
        moved = replace(
            state,
            positions=state.positions + share * update[:-1].reshape(-1, 3),
            pressure=state.pressure + share * pressure,
            height=state.height + share * update[-1],
        )
        return moved, float(np.abs(share * update).max())

    def _nothing(self) -> list[Array]:
        return [np.zeros(group.shape) for group in self.groups[1:]]

    def _admissible(self, state: State, update: Array, least: float) -> float:
        """Largest of 1, 1/2, 1/4, 1/8 of an update that keeps det F positive."""
        motion = update[:-1].reshape(-1, 3)
        before = self.model.determinants(state.positions).min() * min(least, 0.1)
        for share in (1.0, 0.5, 0.25, 0.125) if least < 1.0 else (1.0,):
            if self.model.determinants(state.positions + share * motion).min() > before:
                return share
        raise NotConvergedError("an element turns inside out")


def _node_dofs(nodes: Integers) -> Integers:
    """Degrees of freedom (M, 3 k) of nodes (M, k)."""
    return np.asarray((3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1))
