"""How a breast comes to rest between plates that stand: contact stiffened, damping taken back, contact augmented."""

from dataclasses import replace

import numpy as np

from mammoreg.errors import NotConvergedError
from mammoreg.fem.closed import Closed, closed_state
from mammoreg.fem.closing_options import ClosingOptions
from mammoreg.fem.damped import DampedEquilibrium, DampedState, Load

STIFF_DAMPING = 0.25  # of the first rest in the stiffened contact, as a share of the damping before
REST_SHARE = 0.01  # the damping that remains at the end, as a share of that of the load steps
HARDER = 10.0  # a step that fails is tried again with this much more damping
PATIENCE = 4  # a breast that does not rest yet gets so many times the steps
RESTLESS_MM = 1.0  # a breast that still moves further in its last step has not come to rest


class Resting:
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
            for factor in self.options.stiffening:
                eased = self.eased(contact, eased, damping)
                contact = self.equilibrium.with_contact(self.equilibrium.contact.stiffened(factor))
            return self.rested(self.stiff, eased, STIFF_DAMPING * damping)
        except NotConvergedError:
            if not self.options.stiffening:
                raise
        self.cuts += 1
        return self.rested(self.equilibrium, _unshifted(state), damping)

    def eased(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> DampedState:
        """One step in a contact, damped harder where it fails."""
        for factor in (damping, HARDER * damping):
            try:
                return contact.step(state, self.load, factor, self.options.tolerance_mm)
            except NotConvergedError:
                continue
        return contact.step(state, self.load, HARDER**2 * damping, self.options.tolerance_mm)

    def rested(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> Closed:
        """Steps in a contact with less and less damping until nothing moves.

        Raises:
            NotConvergedError: it does not come to rest.
        """
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
            if moved < 2.0 * tolerance and factor < REST_SHARE * damping:
                break
        if not np.isfinite(moved) or moved > RESTLESS_MM:
            raise NotConvergedError(f"the breast does not come to rest between the plates (last moved {moved:.1f} mm)")
        if self.options.augmentations > 0:
            state = self._augmented(contact, state, REST_SHARE * damping)
        return closed_state(contact, state, self.load, self.gap_mm, moved, self.steps, self.cuts)

    def _augmented(self, contact: DampedEquilibrium, state: DampedState, damping: float) -> DampedState:
        """The contact's shifts renewed until nothing lies too deep in a plate."""
        plates = self.load.plates
        for _ in range(self.options.augmentations):
            if contact.penetration_mm(state, plates) <= self.options.penetration_mm:
                break
            memory = contact.contact.augmented(state.positions, plates, state.height, state.memory)
            state = contact.step(replace(state, memory=memory), self.load, damping, self.options.tolerance_mm)
        return state


def _unshifted(state: DampedState) -> DampedState:
    """The state without the contact's shifts, which belong to the stiffest contact."""
    return replace(state, memory=replace(state.memory, shift=np.zeros(0))) if state.memory.shift.size else state
