"""Plates that close on a patient's breast: load steps of damped equilibria, then rest until nothing moves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, plate_pair, touching
from mammoreg.contact.surface import ContactSurface, Rule
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import BackCondition
from mammoreg.fem.damped import DampedEquilibrium, DampedState, Load
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.parts import Part, all_nodes
from mammoreg.fem.predictor import affine_predictor
from mammoreg.fem.sparse import Array

LEAST_GUESS_DET = 0.2  # an affine guess that squeezes an element further is not used
STIFF_DAMPING = 0.25  # of the first rest in the stiffened contact, as a share of the damping before
REST_SHARE = 0.01  # the damping that remains at the end, as a share of that of the load steps
HARDER = 10.0  # a step that fails is tried again with this much more damping
PATIENCE = 4  # a breast that does not rest yet gets so many times the steps
RESTLESS_MM = 1.0  # a breast that still moves further in its last step has not come to rest
LARGEST_UNBALANCE = 0.02  # of unbalanced to internal forces at rest, without damping
LARGEST_PENETRATION = 0.2  # of the plates' gap


@dataclass(frozen=True)
class ClosingOptions:
    """Numerical settings.

    Attributes:
        steps: load steps at least; more where a step fails.
        least_step: smallest share of the way before giving up.
        tolerance_mm: Newton iterations end below this; the breast rests when it moves less.
        damping: factor of the damping in load steps.
        rests: steps at rest at most.
        penalty_per_mm: stiffness of the contact in units of the mean shear modulus while the plates close.
        stiffening: factors of that stiffness, one after the other, once the plates have closed.
        band_mm: height of the contact's smooth onset.
        slip_mm: displacement at which friction reaches its limit.
        rule: contact points of a face.
    """

    steps: int = 8
    least_step: float = 1.0 / 256.0
    tolerance_mm: float = 0.05
    damping: float = 0.5
    rests: int = 12
    penalty_per_mm: float = 2.0
    band_mm: float = 1.0
    slip_mm: float = 2.5
    rule: Rule = "simpson"
    stiffening: tuple[float, ...] = (3.0, 10.0)


COARSE = ClosingOptions(steps=5, tolerance_mm=0.5, damping=1.0, rests=7, band_mm=2.0)
"""For the search of a pose: answers to some tenths of a millimetre."""


@dataclass(frozen=True)
class Closed:
    """A breast at rest between plates, plate frame.

    Attributes:
        deformed: nodes (N, 3), mm.
        height_mm: height of the lower plate's face.
        gap_mm: distance of the plates' faces.
        force_n: size of the lower and the upper plate's force along the compression.
        iterations, steps, cuts: Newton iterations, load steps, and steps that had to be cut.
        residuals: ratio of unbalanced to internal forces of every iteration.
        restless_mm: displacement of the last step at rest.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        penetration_mm: deepest contact point inside a plate.
        energy_mj: isochoric strain energy.
        state: to go on from.
        extra: extra nodes (M, 3), mm, or None.
    """

    deformed: Array
    height_mm: float
    gap_mm: float
    force_n: tuple[float, float]
    iterations: int
    steps: int
    cuts: int
    residuals: list[float]
    restless_mm: float
    min_det_f: float
    volume_change: float
    penetration_mm: float
    energy_mj: float
    state: DampedState
    extra: Array | None = None


class Closing:
    """A breast, its back and two plates.

    Args:
        model: the breast in the plate frame (medial, posterior, height).
        skin_quads: faces (F, 4) that may touch the plates.
        back: condition of the back.
        edge_p_mm: posterior coordinate where the plates end; None: plates without end.
        lip_radius_mm: radius of their lips there.
        friction: Coulomb coefficient between skin and plates.
        options: numerical settings.
        lower_mm: height of the lower plate's face in the end, where it is known; else the plates' common height
            floats, so that the back carries no net force along the compression.
        parts: what acts beside elements, back and plates.
        extra_nodes: undeformed nodes (M, 3) beside the body's, mm, numbered behind them; `skin_quads`, `back` and
            `parts` may name them.
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
        extra_nodes: Array | None = None,
    ) -> None:
        self.model, self.back, self.edge, self.lip = model, back, edge_p_mm, lip_radius_mm
        self.lower_mm, self.parts, self.extra_nodes = lower_mm, tuple(parts), extra_nodes
        self.points = all_nodes(model.points, extra_nodes)
        self.options = options if options is not None else ClosingOptions()
        mu = float(np.average(model.material.mu_kpa, weights=model.volume))
        surface = ContactSurface(self.points, skin_quads, self.options.rule)
        stiffness = self.options.penalty_per_mm * mu
        self.contact = SoftContact(surface, stiffness, self.options.band_mm, friction, self.options.slip_mm)
        self.predictor = affine_predictor(self.points, back, len(model.points))
        self.low, self.high = touching(surface.positions(self.points).reshape(-1, 3), edge_p_mm, lip_radius_mm)

    @property
    def uncompressed_mm(self) -> float:
        """Height of the part between the plates before compression: the gap at which both touch."""
        return self.high - self.low

    def plates(self, gap_mm: float, share: float = 1.0) -> tuple[Plate, Plate]:
        """Plates at a share of their way: around the middle of first touch, or on the way to their known height."""
        middle = 0.5 * (self.low + self.high)
        if self.lower_mm is not None:
            middle += share * (self.lower_mm + 0.5 * gap_mm - middle)
        return plate_pair(gap_mm, middle, self.edge, self.lip)

    def equilibrium(self, outline: Part | None = None) -> DampedEquilibrium:
        """The equations, with or without an outline that draws on the skin.

        An outline draws towards or away from the source too; the plates, whose height the image knows, stay then.
        """
        floats = self.back.holds_height and self.lower_mm is None and outline is None
        parts = self.parts if outline is None else (*self.parts, outline)
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
        points = self.points
        memory = self.contact.start(points, self.plates(self.uncompressed_mm, 0.0), 0.0)
        state = DampedState(points, np.zeros(len(self.model.hexes)), 0.0, memory)
        done, last, taken, cuts = 0.0, self.uncompressed_mm, 0, 0
        step = 1.0 / self.options.steps
        while done < 1.0:
            share = min(1.0, done + step)
            share = 1.0 if share > 1.0 - 1e-9 else share
            gap = self.uncompressed_mm + (gap_mm - self.uncompressed_mm) * share
            try:
                state = self._advance(equilibrium, state, last, gap, share)
            except NotConvergedError as error:
                cuts, step = cuts + 1, 0.5 * step
                if step < self.options.least_step:
                    raise NotConvergedError(f"{error}; the plates came to {last:.1f} of {gap_mm:.1f} mm") from error
                continue
            done, last, taken = share, gap, taken + 1
            step = min(1.5 * step, 1.0 / self.options.steps)
        return self._settled(equilibrium, state, gap_mm, taken, cuts, self.options.damping)

    def resume(self, state: DampedState, gap_mm: float) -> Closed:
        """Come to rest at a gap from a state near the answer, such as that of a coarser mesh.

        Raises:
            NotConvergedError: with the reason.
        """
        stiffest = self.options.stiffening[-1] if self.options.stiffening else 1.0
        stiff = self.equilibrium().with_contact(self.contact.stiffened(stiffest))
        eased = self._eased(stiff, state, Load(self.plates(gap_mm)), self.options.damping)
        return self._rested(stiff, eased, gap_mm, 1, 0, STIFF_DAMPING * self.options.damping)

    def rest(self, closed: Closed, outline: Part, damping: float) -> Closed:
        """Go on from a closed state with an outline drawing on the skin.

        Raises:
            NotConvergedError: with the reason.
        """
        equilibrium = self.equilibrium(outline)
        lagged = self.parts if closed.state.parts is None else closed.state.parts[: len(self.parts)]
        state = replace(closed.state, parts=(*lagged, outline))
        # Easing the contact first would unload the friction that the closing has built up.
        stiffest = self.options.stiffening[-1] if self.options.stiffening else 1.0
        stiff = equilibrium.with_contact(self.contact.stiffened(stiffest))
        try:
            return self._rested(stiff, state, closed.gap_mm, closed.steps, closed.cuts, damping)
        except NotConvergedError:
            return self._settled(equilibrium, state, closed.gap_mm, closed.steps, closed.cuts, damping)

    def _advance(
        self, equilibrium: DampedEquilibrium, state: DampedState, last: float, gap: float, share: float
    ) -> DampedState:
        load = Load(self.plates(gap, share), share)
        guess = self.predictor.predict(state.positions, state.height, load.plates, gap / last)
        if self.model.determinants(guess).min() < LEAST_GUESS_DET:
            guess = state.positions
        start = replace(state, positions=np.where(equilibrium.held, equilibrium.anchors(share), guess))
        return equilibrium.step(start, load, self.options.damping, self.options.tolerance_mm)

    def _settled(
        self, equilibrium: DampedEquilibrium, state: DampedState, gap_mm: float, taken: int, cuts: int, damping: float
    ) -> Closed:
        """Rest in the stiffened contact or, where that is not found, in the soft one."""
        load, stiff, eased = Load(self.plates(gap_mm)), equilibrium, state
        try:
            for factor in self.options.stiffening:
                eased = self._eased(stiff, eased, load, damping)
                stiff = equilibrium.with_contact(self.contact.stiffened(factor))
            return self._rested(stiff, eased, gap_mm, taken, cuts, STIFF_DAMPING * damping)
        except NotConvergedError:
            if not self.options.stiffening:
                raise
        return self._rested(equilibrium, state, gap_mm, taken, cuts + 1, damping)

    def _eased(self, contact: DampedEquilibrium, state: DampedState, load: Load, damping: float) -> DampedState:
        """One step in a contact, damped harder where it fails."""
        for factor in (damping, HARDER * damping):
            try:
                return contact.step(state, load, factor, self.options.tolerance_mm)
            except NotConvergedError:
                continue
        return contact.step(state, load, HARDER**2 * damping, self.options.tolerance_mm)

    def _rested(
        self, equilibrium: DampedEquilibrium, state: DampedState, gap_mm: float, taken: int, cuts: int, damping: float
    ) -> Closed:
        load = Load(self.plates(gap_mm))
        tolerance, moved, factor = self.options.tolerance_mm, np.inf, damping
        for rest in range(PATIENCE * self.options.rests):
            if rest >= self.options.rests and moved <= RESTLESS_MM:
                break
            try:
                after, reason = equilibrium.approach(state, load, factor, tolerance)
            except NotConvergedError:
                cuts, factor = cuts + 1, HARDER * factor
                continue
            moved = np.inf if reason else float(np.abs(after.positions - state.positions).max())
            state, factor = after, factor if reason else 0.25 * factor
            if moved < 2.0 * tolerance and factor < REST_SHARE * damping:
                break
        if not np.isfinite(moved) or moved > RESTLESS_MM:
            raise NotConvergedError(f"the breast does not come to rest between the plates (last moved {moved:.1f} mm)")
        return self._closed(equilibrium, state, load, gap_mm, taken, cuts, moved)

    def _closed(
        self,
        equilibrium: DampedEquilibrium,
        state: DampedState,
        load: Load,
        gap_mm: float,
        taken: int,
        cuts: int,
        moved: float,
    ) -> Closed:
        terms, unbalance = equilibrium.terms(state, load.plates), equilibrium.unbalance(state, load)
        if unbalance > LARGEST_UNBALANCE:
            raise NotConvergedError(f"forces at rest are out of balance by {unbalance:.1%}")
        if terms.penetration_mm > LARGEST_PENETRATION * gap_mm:
            raise NotConvergedError(
                f"the skin passes the plates by {terms.penetration_mm:.1f} mm at a gap of {gap_mm:.1f} mm"
            )
        count = len(self.model.points)
        forces = np.abs(terms.plate_force[:, 2]) * 1e-3
        return Closed(
            deformed=state.positions[:count],
            height_mm=load.plates[0].height_mm + state.height,
            gap_mm=gap_mm,
            force_n=(float(forces[0]), float(forces[1])),
            iterations=len(equilibrium.residuals),
            steps=taken,
            cuts=cuts,
            residuals=equilibrium.residuals,
            restless_mm=moved,
            min_det_f=float(self.model.determinants(state.positions).min()),
            volume_change=self.model.volume_change(state.positions),
            penetration_mm=terms.penetration_mm,
            energy_mj=self.model.energy_mj(state.positions),
            state=state,
            extra=None if self.extra_nodes is None else state.positions[count:],
        )
