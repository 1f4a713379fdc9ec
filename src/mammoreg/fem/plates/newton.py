"""One implicit step of a damped equilibrium: Newton's method, kept downhill where it does not contract by itself.

Far from an equilibrium Newton's updates bounce between contact and release, or follow a buckling body uphill. An
update that is not clearly smaller than the last one therefore gets a line search until a merit lessens: the potential
of everything that acts, the volume's part at a moderate bulk modulus beside the pressures at hand (an augmented
Lagrangian). With the true modulus every finite update would seem to go uphill, for it keeps the volume to first order
only. Where an update points uphill the tangent is not positive definite; more damping towards the place at hand makes
it so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel, Residual
from mammoreg.fem.linear.system import NewtonSystem
from mammoreg.fem.parts.part import Parts
from mammoreg.fem.plates.state import DampedState, Load
from mammoreg.fem.report import Stopwatch

# All chosen: they change how an equilibrium is reached, not the equilibrium.
LEAST_DET_RATIO = 0.2  # a Newton step may shrink the smallest det F to this part of itself
RUNAWAY_MM = 200.0  # an update beyond the size of a breast is searched along
CONTRACTING = 0.6  # an update above this share of the last one is searched along
PLAIN_ITERATIONS, ITERATIONS = 14, 40  # at most without a line search, and at most
MERIT_BULK = 20.0  # bulk modulus of the merit at most, in shear moduli
LARGEST_MM = 30.0  # of a searched update
DESCENT = 1e-4  # share of the expected descent that is enough
SHORTEST = 1.0 / 64.0  # step length at which a line search gives up
# Further damping where an update points uphill, in units of the damping's weight: first, least kept, factor, trials.
SHIFT, LEAST_SHIFT, SHIFT_GROWTH, SHIFTS = 0.1, 0.01, 5.0, 8
SHORT = 0.2  # a shorter step length asks for more of it


@dataclass(frozen=True)
class ForceBalance:
    """Forces at a state: the elements' residual, and residual and tangent of each group of blocks."""

    internal: Residual
    vectors: list[Floats]
    blocks: list[Floats]


class StepEquations(Protocol):
    """What a step takes from its equilibrium: body, linear system, contact, springs of the back, record."""

    model: HyperelasticModel
    system: NewtonSystem
    watch: Stopwatch
    contact: SoftContact
    springs: Parts
    weight: Floats
    residuals: list[float]

    def terms(self, state: DampedState, plates: Sequence[Plate]) -> SoftTerms:
        """Contact at a state."""


class DampedStep:
    """The equations of one step.

    Args:
        equilibrium: body, contact and linear system.
        start: state towards which the step is damped.
        load: plates.
        acting: parts at the load factor, the back's springs first.
        damping: factor of the damping.
    """

    def __init__(
        self, equilibrium: StepEquations, start: DampedState, load: Load, acting: Parts, damping: float
    ) -> None:
        self.equilibrium, self.start, self.load, self.acting, self.damping = equilibrium, start, load, acting, damping
        self.model, self.system, self.watch = equilibrium.model, equilibrium.system, equilibrium.watch
        self.shift = 0.0

    def solve(self, tolerance_mm: float) -> tuple[DampedState, str]:
        """Iterate until an update is below the tolerance.

        Returns:
            The state, and why it is not yet an equilibrium of the step, empty if it is.

        Raises:
            NotConvergedError: elements turn inside out.
        """
        state, last = self.start, np.inf
        for iteration in range(ITERATIONS):
            balance = self._balance(state)
            self.equilibrium.residuals.append(self.system.unbalance(balance.vectors))
            update, pressure = self._update(balance)
            largest, settles = float(np.abs(update).max()), self.shift == 0.0
            step_length = self._plain_step_length(state, update, largest, last) if iteration < PLAIN_ITERATIONS else 0.0
            if step_length > 0.0:
                state = _moved(state, step_length, update, pressure)
            else:
                state = self._line_search(state, balance, update, pressure)
            if settles and largest < tolerance_mm:
                return state, ""
            last = largest
        return state, f"no equilibrium within {ITERATIONS} Newton iterations (last update {last:.2g} mm)"

    def _plain_step_length(self, state: DampedState, update: Floats, largest: float, last: float) -> float:
        """Step length of an update that needs no line search; 0: it has to be searched along."""
        if self.shift > 0.0 or largest > RUNAWAY_MM or largest > CONTRACTING * last:
            return 0.0
        try:
            step_length = self.system.admissible(state.positions, update, LEAST_DET_RATIO)
        except NotConvergedError:
            return 0.0
        return step_length if np.isinf(last) or step_length == 1.0 else 0.0

    def _balance(self, state: DampedState) -> ForceBalance:
        with self.watch.timing("contact"):
            contact = self.equilibrium.terms(state, self.load.plates)
        with self.watch.timing("assembly"):
            elements = self.model.state(state.positions)
            internal = self.model.residual(elements, state.pressure)
            tangent = self.model.stiffness(elements, state.pressure, internal.coupling)
            pairs = [part.terms(state.positions) for part in self.acting]
        weight, count = self.damping * self.equilibrium.weight, len(self.equilibrium.springs)
        damped = (weight * self._displacement(state))[:, None], weight[:, None, None]
        groups = [(internal.force, tangent), *pairs[:count], (contact.force, contact.stiffness), damped, *pairs[count:]]
        return ForceBalance(internal, [vector for vector, _ in groups], [block for _, block in groups])

    def unbalance(self, state: DampedState) -> float:
        """Ratio of unbalanced to internal forces at a state."""
        return self.system.unbalance(self._balance(state).vectors)

    def _displacement(self, state: DampedState) -> Floats:
        """Displacement (total,) since the start."""
        return np.append((state.positions - self.start.positions).ravel(), state.height - self.start.height)

    def _line_search(self, state: DampedState, balance: ForceBalance, update: Floats, pressure: Floats) -> DampedState:
        """Backtracking line search for less of the merit, along updates that are damped more until there is some."""
        gradient = self._gradient(balance)
        merit = self._merit(state.positions, state.height, state.pressure)
        for _ in range(SHIFTS):
            slope = float(gradient @ update)
            with self.watch.timing("search"):
                step_length = self._descending(state, update, slope, merit) if slope < 0.0 else 0.0
            if step_length > 0.0:
                self._adapt(step_length)
                return _moved(state, step_length, update, pressure)
            self.shift = max(SHIFT_GROWTH * self.shift, SHIFT)
            update, pressure = self._update(balance)
        raise NotConvergedError(self._blame(state, update))

    def _adapt(self, step_length: float) -> None:
        """More damping towards the place at hand after a short step, less after a whole one."""
        if step_length < SHORT:
            self.shift = max(SHIFT_GROWTH * self.shift, SHIFT)
        elif step_length == 1.0:
            self.shift = self.shift / SHIFT_GROWTH if self.shift > LEAST_SHIFT else 0.0

    def _update(self, balance: ForceBalance) -> tuple[Floats, Floats]:
        """Newton's update, with more damping towards the present place where that has turned out to be needed."""
        blocks = list(balance.blocks)
        if self.shift > 0.0:
            place = len(self.equilibrium.springs) + 2
            blocks[place] = blocks[place] + self.shift * self.equilibrium.weight[:, None, None]
        with self.watch.timing("linear"):
            return self.system.increment(balance.internal, balance.vectors, blocks)

    def _descending(self, state: DampedState, update: Floats, slope: float, merit: float) -> float:
        """Step length at which the merit has lessened (Armijo); 0: there is none."""
        before = self.model.determinants(state.positions)
        step_length = min(1.0, LARGEST_MM / float(np.abs(update).max()))
        while step_length > SHORTEST:
            positions = state.positions + step_length * update[:-1].reshape(-1, 3)
            if (self.model.determinants(positions) > LEAST_DET_RATIO * before).all():
                found = self._merit(positions, state.height + step_length * float(update[-1]), state.pressure)
                if found <= merit + DESCENT * step_length * slope + 1e-12 * abs(merit):
                    return step_length
            step_length *= 0.5
        return 0.0

    def _soft_bulk(self) -> Floats:
        """Stiffness (E,) of the merit's volume term, kPa/mm3: as of the bulk modulus in series with a moderate one."""
        material = self.model.material
        moderate = MERIT_BULK * material.mu_kpa
        return np.asarray(material.bulk_kpa * moderate / (material.bulk_kpa + moderate) / self.model.volume)

    def _gradient(self, balance: ForceBalance) -> Floats:
        """Gradient (total,) of the merit, mN."""
        internal = balance.internal
        volumetric = (self._soft_bulk() * internal.volume)[:, None] * internal.coupling
        return self.system.sum([balance.vectors[0] + volumetric, *balance.vectors[1:]])

    def _merit(self, positions: Floats, height: float, pressure: Floats) -> float:
        """Potential, mN mm, of nodes (N, 3) at element pressures (E,)."""
        contact = self.equilibrium.contact.energy_mj(positions, height, self.load.plates, self.start.memory)
        stored = self.model.energy_mj(positions) + contact + sum(part.energy_mj(positions) for part in self.acting)
        grown = (self.model.weights * (self.model.determinants(positions) - 1.0)).sum(axis=1)
        excess = grown - pressure / self.model.bulk_per_volume
        volume = float(np.sum(pressure * grown + 0.5 * self._soft_bulk() * excess**2))
        displacement = np.append((positions - self.start.positions).ravel(), height - self.start.height)
        return 1e3 * stored + volume + 0.5 * self.damping * float(self.equilibrium.weight @ displacement**2)

    def _blame(self, state: DampedState, update: Floats) -> str:
        """Which element is the first to turn inside out along an update, or that none is."""
        before = self.model.determinants(state.positions)
        after = self.model.determinants(state.positions + SHORTEST * update[:-1].reshape(-1, 3))
        worst = int(np.argmin((after / before).min(axis=1)))
        medial, posterior, height = state.positions[self.model.hexes[worst]].mean(axis=0)
        place = f"element {worst} (medial {medial:.0f}, posterior {posterior:.0f}, height {height:.0f} mm)"
        if after[worst].min() <= LEAST_DET_RATIO * before[worst].min():
            return f"{place} turns inside out"
        return f"no way downhill; most strained is {place} with det F {before[worst].min():.2g}"


def _moved(state: DampedState, step_length: float, update: Floats, pressure: Floats) -> DampedState:
    return replace(
        state,
        positions=state.positions + step_length * update[:-1].reshape(-1, 3),
        pressure=state.pressure + step_length * pressure,
        height=state.height + step_length * float(update[-1]),
    )
