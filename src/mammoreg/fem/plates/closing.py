"""Plates that close on a patient's breast, to a gap or to a force: load steps of damped equilibria, then rest."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, plate_pair, touching
from mammoreg.contact.surface import ContactSurface
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition
from mammoreg.fem.parts.part import Part, all_nodes
from mammoreg.fem.plates.equilibrium import DampedEquilibrium
from mammoreg.fem.plates.options import COARSE, ClosingOptions
from mammoreg.fem.plates.predictor import affine_predictor
from mammoreg.fem.plates.relaxation import STIFF_DAMPING, Relaxation
from mammoreg.fem.plates.result import Closed
from mammoreg.fem.plates.state import DampedState, Load

__all__ = ["COARSE", "Closed", "Closing", "ClosingOptions", "Moving"]

LOGGER = logging.getLogger(__name__)

Moving = Literal["both", "upper", "lower"]

LEAST_GUESS_DET = 0.2  # an affine guess that squeezes an element further is not used
LARGEST_STEP = 0.5  # of the load factor, after easy steps
NOMINAL, DEEPEST = 0.5, 0.85  # compression that the load steps of a closing to a force share, and the last one tried
LOADED = 0.2  # compression at which gradual loads are wholly on in a closing to a force
FORCE_TOLERANCE = 0.005
FORCE_ROUNDS = 10
LARGEST_CORRECTION = 0.2  # of the gap, in the search for a force


@dataclass(frozen=True)
class LoadStep:
    """Where a load step has ended: the state and the plates' gap there, load steps taken and failed so far."""

    state: DampedState
    gap_mm: float
    steps: int = 0
    cuts: int = 0


class Closing:
    """A breast, its back and two plates.

    Args:
        model: the breast in the plate frame (medial, posterior, height).
        skin_quads: faces (F, 4) that may touch the plates.
        back: condition of the back.
        edge_p_mm: posterior coordinate where the plates end; None: plates without end.
        lip_radius_mm: radius of their lips there.
        friction: Coulomb coefficient between skin and plates; infinite: skin that touches sticks.
        options: numerical settings.
        lower_mm: height of the lower plate's face in the end, where it is known; else the plates' common height
            floats, so that the back carries no net force along the compression.
        parts: what acts beside elements, back and plates.
        extra_nodes: undeformed nodes (M, 3) beside the body's, mm, numbered behind them; `skin_quads`, `back` and
            `parts` may name them.
        moving: which plates move; one that does not stays where it first touches.

    Raises:
        DataError: the plates end in front of the whole breast.
        ValueError: one plate moves, but `lower_mm` says where both end.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        skin_quads: NDArray[np.integer],
        back: BackCondition,
        edge_p_mm: float | None = None,
        lip_radius_mm: float = 5.0,
        friction: float = 0.0,
        options: ClosingOptions | None = None,
        lower_mm: float | None = None,
        parts: Sequence[Part] = (),
        extra_nodes: Floats | None = None,
        moving: Moving = "both",
    ) -> None:
        if moving != "both" and lower_mm is not None:
            raise ValueError("lower_mm says where both plates end; then moving must be 'both'")
        self.model, self.back, self.edge, self.lip = model, back, edge_p_mm, lip_radius_mm
        self.lower_mm, self.parts, self.extra_nodes, self.moving = lower_mm, tuple(parts), extra_nodes, moving
        self.points = all_nodes(model.points, extra_nodes)
        self.options = options if options is not None else ClosingOptions()
        mu = model.mean_mu_kpa
        surface = ContactSurface(self.points, skin_quads, self.options.rule)
        stiffness = self.options.penalty_per_mm * mu
        self.contact = SoftContact(surface, stiffness, self.options.band_mm, friction, self.options.slip_mm)
        self.predictor = affine_predictor(self.points, back, len(model.points))
        self.low, self.high = touching(surface.positions(self.points).reshape(-1, 3), edge_p_mm, lip_radius_mm)

    @property
    def uncompressed_mm(self) -> float:
        """Height of the part between the plates before compression: the gap at which both touch."""
        return self.high - self.low

    def plates(self, gap_mm: float, load_factor: float = 1.0) -> tuple[Plate, Plate]:
        """Plates at a load factor: around the middle of first touch, or on the way to their known height."""
        middle = 0.5 * (self.low + self.high)
        if self.lower_mm is not None:
            middle += load_factor * (self.lower_mm + 0.5 * gap_mm - middle)
        elif self.moving == "upper":
            middle = self.low + 0.5 * gap_mm
        elif self.moving == "lower":
            middle = self.high - 0.5 * gap_mm
        return plate_pair(gap_mm, middle, self.edge, self.lip)

    def equilibrium(self, outline: Part | None = None) -> DampedEquilibrium:
        """The equations, with or without an outline that draws on the skin.

        An outline draws towards or away from the source too; the plates, whose height the image knows, stay then.
        """
        known = self.lower_mm is not None or self.moving != "both" or outline is not None
        parts = self.parts if outline is None else (*self.parts, outline)
        floats = self.back.holds_height and not known
        return DampedEquilibrium(
            self.model, self.back, self.contact, free_height=floats, parts=parts, extra_nodes=self.extra_nodes
        )

    def close(self, gap_mm: float) -> Closed:
        """Close the plates from first touch to a gap and let the breast come to rest.

        Raises:
            NotConvergedError: with the reason and how far the plates came.
        """
        if gap_mm >= self.uncompressed_mm:
            raise NotConvergedError(
                f"the plates' gap of {gap_mm:.1f} mm does not compress a breast of {self.uncompressed_mm:.1f} mm"
            )
        equilibrium = self.equilibrium()
        reached = self._march(equilibrium, gap_mm, 1.0 / self.options.steps)[-1]
        return self._relaxation(equilibrium, gap_mm, reached).settled(reached.state, self.options.damping)

    def close_to_force(self, force_n: float) -> Closed:
        """Close the plates until the mean of their forces is `force_n`, within half a percent; `gap_mm` says where.

        Raises:
            ValueError: the force is not positive.
            NotConvergedError: the force is not reached, or as `close`.
        """
        if force_n <= 0.0:
            raise ValueError(f"the plates' force must be positive, not {force_n} N")
        equilibrium = self.equilibrium()
        deepest = (1.0 - DEEPEST) * self.uncompressed_mm

        def enough(reached: LoadStep) -> bool:
            return self._force_n(equilibrium, reached) >= force_n

        path = self._march(equilibrium, deepest, NOMINAL / DEEPEST / self.options.steps, LOADED / DEEPEST, enough)
        if not enough(path[-1]):
            raise NotConvergedError(
                f"a force of {force_n:.1f} N is not reached: at a gap of {deepest:.1f} mm the plates press with "
                f"{self._force_n(equilibrium, path[-1]):.1f} N"
            )
        return self._sought(equilibrium, path, force_n)

    def resume(self, state: DampedState, gap_mm: float) -> Closed:
        """Come to rest at a gap from a state near the answer, such as that of a coarser mesh.

        Raises:
            NotConvergedError: with the reason.
        """
        relaxation = self._relaxation(self.equilibrium(), gap_mm, LoadStep(state, gap_mm, 1))
        eased = relaxation.eased(relaxation.stiff, state, self.options.damping)
        return relaxation.rested(eased, STIFF_DAMPING * self.options.damping)

    def further(self, closed: Closed, gap_mm: float) -> Closed:
        """Go on from a closed state, which was not tied to an outline, to a narrower gap in one step.

        Raises:
            NotConvergedError: with the reason.
        """
        reached = LoadStep(closed.state, closed.gap_mm, closed.steps, closed.cuts)
        return self._closed_further(self.equilibrium(), reached, gap_mm, soft=False)

    def rest(self, closed: Closed, outline: Part, damping: float) -> Closed:
        """Go on from a closed state with an outline drawing on the skin.

        Raises:
            NotConvergedError: with the reason.
        """
        lagged = self.parts if closed.state.parts is None else closed.state.parts[: len(self.parts)]
        state = replace(closed.state, parts=(*lagged, outline))
        reached = LoadStep(state, closed.gap_mm, closed.steps, closed.cuts)
        relaxation = self._relaxation(self.equilibrium(outline), closed.gap_mm, reached)
        # Easing the contact first would unload the friction that the closing has built up.
        try:
            return relaxation.rested(state, damping)
        except NotConvergedError:
            return relaxation.settled(state, damping)

    def _relaxation(self, equilibrium: DampedEquilibrium, gap_mm: float, reached: LoadStep) -> Relaxation:
        return Relaxation(equilibrium, self.options, Load(self.plates(gap_mm)), gap_mm, reached.steps, reached.cuts)

    def _march(
        self,
        equilibrium: DampedEquilibrium,
        gap_mm: float,
        first: float,
        loaded: float = 1.0,
        enough: Callable[[LoadStep], bool] = lambda _: False,
    ) -> list[LoadStep]:
        """Load steps from first touch to a gap, or until it is enough.

        Args:
            equilibrium: the equations.
            gap_mm: end of the way.
            first: increment of the load factor in a step; less where one fails, more after easy ones.
            loaded: load factor at which gradual loads are wholly on.
            enough: whether to stop.

        Raises:
            NotConvergedError: with the reason and how far the plates came.
        """
        start = self.contact.start(self.points, self.plates(self.uncompressed_mm, 0.0), 0.0)
        state = DampedState(self.points, np.zeros(len(self.model.hexes)), 0.0, start)
        path, done, increment, cuts = [LoadStep(state, self.uncompressed_mm)], 0.0, first, 0
        while done < 1.0 and not enough(path[-1]):
            load_factor = min(1.0, done + increment)
            load_factor = 1.0 if load_factor > 1.0 - 1e-9 else load_factor
            gap = self.uncompressed_mm + (gap_mm - self.uncompressed_mm) * load_factor
            before = len(equilibrium.residuals)
            try:
                state = self._advance(equilibrium, path[-1], gap, min(1.0, load_factor / loaded))
            except NotConvergedError as error:
                cuts, increment = cuts + 1, 0.5 * increment
                LOGGER.info("plates at %.1f mm: step to %.1f mm halved (%s)", path[-1].gap_mm, gap, error)
                if increment < self.options.least_step:
                    came = f"the plates came to {path[-1].gap_mm:.1f} of {gap_mm:.1f} mm"
                    raise NotConvergedError(f"{error}; {came}") from error
                continue
            done = load_factor
            path.append(LoadStep(state, gap, path[-1].steps + 1, cuts))
            easy = len(equilibrium.residuals) - before <= self.options.easy_iterations
            increment = min(2.0 * increment, LARGEST_STEP) if easy else min(1.5 * increment, max(increment, first))
        iterations = len(equilibrium.residuals)
        LOGGER.info("plates at %.1f mm: %d load steps, %d iterations", path[-1].gap_mm, path[-1].steps, iterations)
        return path

    def _advance(
        self, equilibrium: DampedEquilibrium, reached: LoadStep, gap: float, load_factor: float
    ) -> DampedState:
        load, state = Load(self.plates(gap, load_factor), load_factor), reached.state
        guess = self.predictor.predict(state.positions, state.height, load.plates, gap / reached.gap_mm)
        if self.model.determinants(guess).min() < LEAST_GUESS_DET:
            guess = state.positions
        held, anchors = equilibrium.held, equilibrium.anchors(load_factor)
        positions = np.where(held, anchors, guess)
        if self.model.determinants(positions).min() <= 0.0:
            positions = np.where(held, anchors, state.positions)
        start = replace(state, positions=positions)
        return equilibrium.step(start, load, self.options.damping, self.options.tolerance_mm)

    def _force_n(self, equilibrium: DampedEquilibrium, reached: LoadStep) -> float:
        """Mean size of the plates' forces along the compression."""
        forces = equilibrium.terms(reached.state, self.plates(reached.gap_mm)).plate_force
        return 1e-3 * float(np.abs(forces[:, 2]).mean())

    def _sought(self, equilibrium: DampedEquilibrium, path: list[LoadStep], force_n: float) -> Closed:
        """Rest at the gap whose force is wanted: a secant on its logarithm from the last two load steps on."""
        loads = [np.log(max(self._force_n(equilibrium, reached), 1e-3 * force_n)) for reached in path[-2:]]
        rate = (loads[1] - loads[0]) / (path[-1].gap_mm - path[-2].gap_mm)
        reached, wanted, closed = path[-2], float(np.log(force_n)), None
        gap = float(np.clip(reached.gap_mm + (wanted - loads[0]) / rate, path[-1].gap_mm, reached.gap_mm))
        for _ in range(FORCE_ROUNDS):
            before, last = closed, reached.gap_mm
            closed = self._closed_further(equilibrium, reached, gap, soft=closed is None)
            load = _log_force(closed)
            if abs(np.expm1(load - wanted)) < FORCE_TOLERANCE:
                return closed
            if before is not None and gap != last:
                rate = (load - _log_force(before)) / (gap - last)
            reached = LoadStep(closed.state, gap, closed.steps, closed.cuts)
            gap += float(np.clip((wanted - load) / rate, -LARGEST_CORRECTION * gap, LARGEST_CORRECTION * gap))
        raise NotConvergedError(f"no gap found at which the plates press with {force_n:.1f} N; last {gap:.1f} mm")

    def _closed_further(self, equilibrium: DampedEquilibrium, reached: LoadStep, gap: float, *, soft: bool) -> Closed:
        """Rest at a gap from one near it: of a load step in the soft contact, or of a body at rest."""
        relaxation = self._relaxation(equilibrium, gap, reached)
        if soft:
            return relaxation.settled(self._advance(equilibrium, reached, gap, 1.0), self.options.damping)
        stiff = self._advance(relaxation.stiff, reached, gap, 1.0)
        return relaxation.rested(stiff, STIFF_DAMPING * self.options.damping)


def _log_force(closed: Closed) -> float:
    return float(np.log(0.5 * sum(closed.force_n)))
