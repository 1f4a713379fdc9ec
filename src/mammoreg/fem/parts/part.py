"""What acts on a body beside its elements and the plates: springs, ties, loads, skin; each is a `Part`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.linear.system import node_dofs
from mammoreg.fem.parts.back import BackCondition


@runtime_checkable
class Part(Protocol):
    """Blocks of residual and stiffness over the nodes; positions (N, 3), mm, hold the body's nodes, then extra ones."""

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (B, size) of the blocks: 3 * node + axis."""

    def terms(self, positions: Floats, /) -> tuple[Floats, Floats]:
        """Residual (B, size), mN, and its symmetric derivative (B, size, size), mN/mm."""

    def energy_mj(self, positions: Floats, /) -> float:
        """Stored energy or, of loads, potential: the residual is its gradient."""

    def renewed(self, positions: Floats, /) -> "Part":
        """The part after a converged load step, with what it takes from there (partners, lagged state)."""


@runtime_checkable
class GradualPart(Part, Protocol):
    """A part that is brought on with the load steps."""

    def at(self, load_factor: float, /) -> "Part":
        """The part at a load factor, 1 in the end; same `dofs`."""


Parts = tuple[Part, ...]


def parts_at(parts: Sequence[Part], load_factor: float) -> Parts:
    """Parts at a load factor; those that are not gradual act wholly."""
    return tuple(part.at(load_factor) if isinstance(part, GradualPart) else part for part in parts)


@dataclass(frozen=True)
class BackSprings:
    """Springs from the back's nodes to their anchors.

    Attributes:
        nodes: (B,).
        stiffness: (B, 3, 3), mN/mm.
        rest: undeformed places (B, 3), mm.
        pull_mm: displacement (3,) of the anchors.
    """

    nodes: Integers
    stiffness: Floats
    rest: Floats
    pull_mm: Floats

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (B, 3)."""
        return node_dofs(self.nodes[:, None])

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (B, 3), mN, and stiffness (B, 3, 3), mN/mm."""
        return np.einsum("bij,bj->bi", self.stiffness, self._stretch(positions)), self.stiffness

    def energy_mj(self, positions: Floats) -> float:
        """Energy in the springs."""
        stretch = self._stretch(positions)
        return 0.5e-3 * float(np.einsum("bi,bij,bj->", stretch, self.stiffness, stretch))

    def renewed(self, _positions: Floats) -> "BackSprings":
        """Itself."""
        return self

    def at(self, load_factor: float) -> "BackSprings":
        """The springs at a load factor of the pull."""
        return replace(self, pull_mm=load_factor * self.pull_mm)

    def _stretch(self, positions: Floats) -> Floats:
        return np.asarray(positions[self.nodes] - (self.rest + self.pull_mm))


def back_springs(back: BackCondition | None, points: Floats) -> tuple[BackSprings, ...]:
    """The springs of a back over undeformed nodes (N, 3), mm; none where it has none."""
    if back is None or not back.springs.any():
        return ()
    return (BackSprings(back.nodes, back.springs, points[back.nodes], back.pull_mm),)


def all_nodes(points: Floats, extra_nodes: Floats | None) -> Floats:
    """Undeformed nodes (N + M, 3) of a body and behind them the extra ones.

    Raises:
        ValueError: extra nodes are not (M, 3).
    """
    if extra_nodes is None:
        return points
    extra = np.asarray(extra_nodes, dtype=float)
    if extra.ndim != 2 or extra.shape[1] != 3:
        raise ValueError(f"extra nodes must be (M, 3), not {extra.shape}")
    return np.concatenate([points, extra])
