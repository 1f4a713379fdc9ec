"""How a breast comes to rest between plates that stand: contact stiffened, damping taken back, contact augmented."""

from dataclasses import replace

import numpy as np

from mammoreg.errors import NotConvergedError
from mammoreg.fem.plates.equilibrium import DampedEquilibrium
from mammoreg.fem.plates.options import ClosingOptions
from mammoreg.fem.plates.result import Closed, closed_state
from mammoreg.fem.plates.state import DampedState, Load

STIFF_DAMPING = 0.25  # of the first rest in the stiffened contact, as a share of the damping before
REST_DAMPING = 0.01  # the damping that remains at the end, as a share of that of the load steps
HARDER = 10.0  # a step that fails is tried again with this much more damping
PATIENCE = 4  # a breast that does not rest yet gets so many times the steps
# Skin deeper in the plates, as a share of their gap, hardens the contact by a factor, so many times at most.
DEEP, HARDENINGS, HARDER_CONTACT = 0.05, 4, 3.0
LARGEST_PENETRATION = 0.2  # of the gap: no longer a breast between plates
RESTLESS_MM = 1.0  # a breast that still moves further in its last step has not come to rest


class Relaxation:
    """A breast between plates that stand.

    Args:
        equilibrium: its equations with the contact of the load steps.
        options: numerical settings.
        load: the plates.
        gap_mm: between their faces.
        steps, cuts: load steps so far and those that failed.

    Attributes:
        stiff: the equations with the stiffest contact.
    """

    def __init__(
        self,
        equilibrium: DampedEquilibrium,
        options: ClosingOptions,
        load: Load,
        gap_mm: float,
        steps: int,
        cuts: int,
    ) -> None:
        self.equilibrium, self.options, self.load, self.gap_mm = equilibrium, options, load, gap_mm
        self.steps, self.cuts = steps, cuts
        self.stiff = equilibrium.with_contact(equilibrium.contact.stiffened(options.stiffest))

    def settled(self, state: DampedState, damping: float) -> Closed:
        """Rest in the stiffened contact or, where that is not found, in the soft one.

        Raises:
            NotConvergedError: it does not come to rest.
        """
        contact, eased = self.equilibrium, _unshifted(state)
        try:
            for factor in self.options.contact_factors:
                eased = self.eased(contact, eased, damping)
                contact = self.equilibrium.with_contact(self.equilibrium.contact.stiffened(factor))
            closed = self._rested(self.stiff, eased, STIFF_DAMPING * damping)
        except NotConvergedError:
            if not self.options.contact_factors:
                raise
            self.cuts += 1
            return self._between(self._rested(self.equilibrium, _unshifted(state), damping))
        return self._between(self._hardened(closed, damping))

    def eased(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> DampedState:
        """One step in a contact, damped harder where it fails."""
        for factor in (damping, HARDER * damping):
            try:
                return contact.step(state, self.load, factor, self.options.tolerance_mm)
            except NotConvergedError:
                continue
        return contact.step(state, self.load, HARDER**2 * damping, self.options.tolerance_mm)

    def rested(self, state: DampedState, damping: float) -> Closed:
        """Steps in the stiffest contact with less and less damping until nothing moves.

        Raises:
            NotConvergedError: it does not come to rest.
        """
        return self._between(self._rested(self.stiff, state, damping))

    def _hardened(self, closed: Closed, damping: float) -> Closed:
        """At rest in contacts stiffer still, as tissue needs that has become stiffer by far than it was at first."""
        factor = self.options.stiffest
        for _ in range(HARDENINGS if self.options.contact_factors else 0):
            if self.stiff.penetration_mm(closed.state, self.load.plates) <= DEEP * self.gap_mm:
                break
            factor *= HARDER_CONTACT
            contact = self.equilibrium.with_contact(self.equilibrium.contact.stiffened(factor))
            try:
                eased = self.eased(contact, _unshifted(closed.state), damping)
                closed = self._rested(contact, eased, STIFF_DAMPING * damping)
            except NotConvergedError:
                self.cuts += 1
                break
        return closed

    def _between(self, closed: Closed) -> Closed:
        """The result, if it is a breast between plates.

        Raises:
            NotConvergedError: it is not.
        """
        if max(closed.force_n) == 0.0:
            raise NotConvergedError(
                f"the breast has left the plates: neither presses it at a gap of {self.gap_mm:.1f} mm"
            )
        passed = self.stiff.penetration_mm(closed.state, self.load.plates)
        if passed > LARGEST_PENETRATION * self.gap_mm:
            raise NotConvergedError(f"the skin passes the plates by {passed:.1f} mm at a gap of {self.gap_mm:.1f} mm")
        return closed

    def _rested(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> Closed:
        """Steps in a contact with less and less damping until nothing moves."""
        tolerance, moved, factor = self.options.tolerance_mm, np.inf, damping
        for rest in range(PATIENCE * self.options.rests):
            if rest >= self.options.rests and moved <= RESTLESS_MM:
                break
            try:
                after, reason = contact.approach(state, self.load, factor, tolerance)
            except NotConvergedError:
                self.cuts, factor = self.cuts + 1, HARDER * factor
                continue
            moved = np.inf if reason else float(np.abs(after.positions - state.positions).max())
            state, factor = after, factor if reason else 0.25 * factor
            if moved < 2.0 * tolerance and factor < REST_DAMPING * damping:
                break
        if not np.isfinite(moved) or moved > RESTLESS_MM:
            raise NotConvergedError(f"the breast does not come to rest between the plates (last moved {moved:.1f} mm)")
        if self.options.augmentations > 0:
            state = self._augmented(contact, state, REST_DAMPING * damping)
        return closed_state(contact, state, self.load, self.gap_mm, moved, self.steps, self.cuts)

    def _augmented(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> DampedState:
        """The contact's shifts renewed until nothing lies too deep in a plate."""
        plates = self.load.plates
        for _ in range(self.options.augmentations):
            if contact.penetration_mm(state, plates) <= self.options.penetration_mm:
                break
            memory = contact.contact.augmented(state.positions, plates, state.height, state.memory)
            try:
                state = contact.step(replace(state, memory=memory), self.load, damping, self.options.tolerance_mm)
            except NotConvergedError:
                break  # the state before is an equilibrium too, and says how deep the skin lies
        return state


def _unshifted(state: DampedState) -> DampedState:
    """The state without the contact's shifts, which belong to the stiffest contact."""
    return replace(state, memory=replace(state.memory, shift=np.zeros(0))) if state.memory.shift.size else state
