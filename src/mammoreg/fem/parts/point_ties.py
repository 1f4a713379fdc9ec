"""Springs that draw material points of a body's faces to places: the additional surface points of Table III."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.linear.system import node_dofs


@dataclass(frozen=True)
class PointTies:
    """Points on quadrilateral faces, each drawn by a spring to a place that moves there with the load steps.

    Attributes:
        nodes: corners (T, 4) of the face that carries each point.
        shape: weights (T, 4) of the corners at the point.
        rest: places (T, 3) of the undeformed points, mm.
        target: where they are drawn to (T, 3), mm.
        stiffness: spring constants (T,), mN/mm.
    """

    nodes: Integers
    shape: Floats
    rest: Floats
    target: Floats
    stiffness: Floats

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (T, 12) of the faces' corners."""
        return node_dofs(self.nodes)

    def points(self, positions: Floats) -> Floats:
        """The tied points (T, 3) at deformed nodes (N, 3), mm."""
        return np.asarray(np.einsum("ta,tai->ti", self.shape, positions[self.nodes]))

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (T, 12), mN, and stiffness (T, 12, 12), mN/mm."""
        pull = self.stiffness[:, None] * (self.points(positions) - self.target)
        force = self.shape[:, :, None] * pull[:, None, :]
        stiffness = self.stiffness[:, None, None] * self.shape[:, :, None] * self.shape[:, None, :]
        blocks = stiffness[:, :, None, :, None] * np.eye(3)[None, None, :, None, :]
        return force.reshape(-1, 12), blocks.reshape(-1, 12, 12)

    def energy_mj(self, positions: Floats) -> float:
        """Energy in the springs."""
        return 0.5e-3 * float(self.stiffness @ ((self.points(positions) - self.target) ** 2).sum(axis=1))

    def renewed(self, _positions: Floats) -> "PointTies":
        """Itself."""
        return self

    def at(self, load_factor: float) -> "PointTies":
        """Springs towards places that have come as far as the load factor says."""
        return replace(self, target=self.rest + load_factor * (self.target - self.rest))


def point_ties(
    points: Floats, corners: NDArray[np.integer], weights: Floats, targets: Floats, stiffness: float | Floats
) -> PointTies:
    """Ties of points given by the faces that carry them.

    Args:
        points: undeformed nodes (N, 3), mm.
        corners: of the face of each point (T, 4).
        weights: of the corners at the point (T, 4), from 0 to 1, 1 together.
        targets: where the points are drawn to (T, 3), mm.
        stiffness: spring constants, scalar or (T,), mN/mm.

    Raises:
        ValueError: a point is not on its face, or a spring is not stiff.
    """
    shape, nodes = np.asarray(weights, dtype=float), np.asarray(corners, dtype=np.int64)
    if np.any(shape < -1e-9) or not np.allclose(shape.sum(axis=1), 1.0):
        raise ValueError("points of ties must lie on their faces: weights from 0 to 1 that add up to 1")
    spring = np.broadcast_to(np.asarray(stiffness, dtype=float), (len(shape),)).copy()
    if not np.all(spring > 0.0):
        raise ValueError("springs of ties must have a positive stiffness")
    rest = np.einsum("ta,tai->ti", shape, np.asarray(points, dtype=float)[nodes])
    return PointTies(nodes, shape, rest, np.asarray(targets, dtype=float), spring)
