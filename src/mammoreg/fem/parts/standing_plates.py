"""Plates that stand: their contact with the faces of a body whose skin is prescribed, as a part."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftContact, SoftMemory, SoftTerms
from mammoreg.fem.linear.system import node_dofs


@dataclass(frozen=True)
class StandingPlates:
    """Soft contact of faces with two plates that do not move.

    Attributes:
        contact: the faces and the law of the contact.
        plates: lower and upper.
        height_mm: by which both are raised.
        memory: what the contact points remember.
    """

    contact: SoftContact
    plates: tuple[Plate, Plate]
    height_mm: float
    memory: SoftMemory

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (F, 12) of the faces' corners."""
        return node_dofs(self.contact.surface.quads)

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (F, 12), mN, and stiffness (F, 12, 12), mN/mm."""
        found = self._contact(positions)
        return found.force[:, :12], found.stiffness[:, :12, :12]

    def energy_mj(self, positions: Floats) -> float:
        """Potential of the pressure and of friction with its lagged limit."""
        return self.contact.energy_mj(positions, self.height_mm, self.plates, self.memory)

    def renewed(self, positions: Floats) -> "StandingPlates":
        """The plates after a converged step, whose pressure limits friction in the next one."""
        found = self._contact(positions)
        memory = self.contact.remember(positions, self.plates, self.height_mm, found, self.memory)
        return replace(self, memory=memory)

    def beside(self, nodes: NDArray[np.integer]) -> "StandingPlates":
        """The contact of those faces that have a corner beside `nodes` (B,): the others' corners are all prescribed."""
        free = np.asarray(~np.isin(self.contact.surface.quads, nodes).all(axis=1))
        return replace(self, contact=self.contact.part(free), memory=self.memory.part(free))

    def penetration_mm(self, positions: Floats) -> float:
        """How deep the deepest contact point lies in a plate."""
        return max(0.0, self._contact(positions).penetration_mm)

    def force_n(self, positions: Floats, reaction_n: Floats, nodes: NDArray[np.integer]) -> tuple[float, float]:
        """Size of the lower and the upper plate's force along the compression.

        The plates' force on faces whose corners are all prescribed is part of what holds these corners.

        Args:
            positions: nodes (N, 3), mm.
            reaction_n: force (N, 3) that holds each node, beside these plates' on the faces `beside` the prescribed.
            nodes: prescribed (B,).
        """
        points = self.contact.points(positions, self.height_mm)
        free = self.beside(nodes)._contact(positions).plate_force[:, 2]
        sizes = []
        for plate, pressed_mn in zip(self.plates, free, strict=True):
            near = (plate.gap(points).distance < self.contact.band_mm).any(axis=1)
            holding = np.intersect1d(self.contact.surface.quads[near], nodes)
            sizes.append(abs(1e-3 * float(pressed_mn) + float(reaction_n[holding, 2].sum())))
        return sizes[0], sizes[1]

    def _contact(self, positions: Floats) -> SoftTerms:
        return self.contact.terms(positions, self.height_mm, self.plates, self.memory)
