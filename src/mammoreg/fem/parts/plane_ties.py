"""Springs that draw points of a body's faces onto planes: how an outline acts on the skin."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.linear.system import node_dofs


@dataclass(frozen=True)
class PlaneTies:
    """Points on quadrilateral faces, each drawn to a plane by a spring along its normal.

    Attributes:
        nodes: corners (T, 4) of the face that carries each point.
        shape: weights (T, 4) of the corners at the point.
        direction: unit normals (T, 3) of the planes.
        offset: places (T,) of the planes along their normals, mm.
        stiffness: spring constants (T,), mN/mm.
    """

    nodes: NDArray[np.int64]
    shape: Floats
    direction: Floats
    offset: Floats
    stiffness: Floats

    def kept(self, which: NDArray[np.bool_]) -> "PlaneTies":
        """Those of the ties that a mask (T,) selects."""
        return PlaneTies(
            self.nodes[which], self.shape[which], self.direction[which], self.offset[which], self.stiffness[which]
        )

    def joined(self, other: "PlaneTies") -> "PlaneTies":
        """These ties and those of another set."""
        return PlaneTies(
            np.concatenate([self.nodes, other.nodes]),
            np.concatenate([self.shape, other.shape]),
            np.concatenate([self.direction, other.direction]),
            np.concatenate([self.offset, other.offset]),
            np.concatenate([self.stiffness, other.stiffness]),
        )

    def points(self, positions: Floats) -> Floats:
        """The tied points (T, 3) at deformed nodes (N, 3), mm."""
        return np.asarray(np.einsum("ta,tai->ti", self.shape, positions[self.nodes]))

    def distance(self, positions: Floats) -> Floats:
        """Distance (T,) of the points from their planes at deformed nodes (N, 3), mm."""
        return np.asarray(np.einsum("ti,ti->t", self.points(positions), self.direction) - self.offset)

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (T, 12) of the faces' corners."""
        return node_dofs(self.nodes)

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (T, 12), mN, and stiffness (T, 12, 12), mN/mm."""
        return self.force(positions), self.blocks()

    def energy_mj(self, positions: Floats) -> float:
        """Energy in the springs."""
        return 0.5e-3 * float(np.sum(self.stiffness * self.distance(positions) ** 2))

    def renewed(self, _positions: Floats) -> "PlaneTies":
        """Itself."""
        return self

    def force(self, positions: Floats) -> Floats:
        """Residual (T, 12) in mN."""
        pull = self.stiffness * self.distance(positions)
        return np.asarray(self._rows() * pull[:, None])

    def blocks(self) -> Floats:
        """Stiffness (T, 12, 12) in mN/mm, constant."""
        rows = self._rows()
        return np.asarray(self.stiffness[:, None, None] * rows[:, :, None] * rows[:, None, :])

    def _rows(self) -> Floats:
        return np.asarray((self.shape[:, :, None] * self.direction[:, None, :]).reshape(len(self.nodes), 12))
