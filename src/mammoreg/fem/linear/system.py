"""The linear system of one Newton iteration: blocks of elements and supports, pressures eliminated."""

import logging
from collections.abc import Sequence

import numpy as np

from mammoreg.arrays import Floats, Integers
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel, Residual
from mammoreg.fem.linear.direct import PardisoSolver, SuperLuSolver, linear_solver
from mammoreg.fem.linear.hierarchy import Hierarchy
from mammoreg.fem.linear.saddle import SaddleSystem
from mammoreg.fem.linear.sparse import Assembler

_log = logging.getLogger(__name__)

SHORTEST_UPDATE = 1.0 / 16.0
DIRECT_UNKNOWNS = 20_000  # up to here a direct solve is faster than an iterative one


class NewtonSystem:
    """Degrees of freedom and linear solvers of a body; the blocks of the elements come first.

    Large bodies on structured blocks are solved iteratively, where that does not converge directly; others directly.

    Args:
        model: the body.
        groups: degrees of freedom (blocks, size) of further blocks (springs, contact, ...), symmetric ones.
        free: the unknowns, ascending.
        total: number of degrees of freedom; the nodes' are the first.
        hierarchy: grids for the iterative solver; default those of a structured block with many unknowns.

    Attributes:
        krylov: iterations of each iterative solve so far.
        factorisations: direct solves so far.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        groups: Sequence[Integers],
        free: Integers,
        total: int,
        hierarchy: Hierarchy | None = None,
    ) -> None:
        self.model, self.free, self.total = model, free, total
        self.groups = [model.dofs, *groups]
        self._index = np.concatenate([group.ravel() for group in self.groups])
        if hierarchy is None and len(free) > DIRECT_UNKNOWNS:
            hierarchy = Hierarchy.of(model.hexes)
        self._iterative = None if hierarchy is None else SaddleSystem(model, groups, free, total, hierarchy)
        self._direct: tuple[Assembler, PardisoSolver | SuperLuSolver] | None = None
        self.factorisations = 0

    @property
    def krylov(self) -> list[int]:
        """Iterations of each iterative solve so far."""
        return [] if self._iterative is None else self._iterative.iterations

    def sum(self, vectors: Sequence[Floats]) -> Floats:
        """Assemble block vectors, one array per group, over all degrees of freedom (total,)."""
        flat = np.concatenate([vector.ravel() for vector in vectors])
        return np.asarray(np.bincount(self._index, weights=flat, minlength=self.total), dtype=float)

    def unbalance(self, vectors: Sequence[Floats]) -> float:
        """Ratio of unbalanced to internal forces."""
        scale = float(np.linalg.norm(self.sum([np.abs(vector) for vector in vectors])))
        return float(np.linalg.norm(self.sum(vectors)[self.free])) / max(scale, 1e-12)

    def increment(
        self, internal: Residual, vectors: Sequence[Floats], blocks: Sequence[Floats], imposed: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Newton update (total,) of the degrees of freedom and (E,) of the pressures.

        Args:
            internal: the elements' residual; its `force` is the first of `vectors`.
            vectors, blocks: residual and tangent of each group; the elements' with pressures eliminated.
            imposed: increments (total,) of degrees of freedom that are not free.

        Raises:
            NotConvergedError: the matrix is singular.
        """
        if self._iterative is not None:
            try:
                return self._iterative.increment(internal, self.sum(vectors), blocks, imposed)
            except NotConvergedError as error:
                _log.info("direct instead of iterative linear solve: %s", error)
        return self._direct_increment(internal, vectors, blocks, imposed)

    def _direct_increment(
        self, internal: Residual, vectors: Sequence[Floats], blocks: Sequence[Floats], imposed: Floats | None
    ) -> tuple[Floats, Floats]:
        rate = self.model.bulk_per_volume
        correction = (rate * internal.volume)[:, None] * internal.coupling
        residual = self.sum([vectors[0] + correction, *vectors[1:]])
        update = np.zeros(self.total)
        if imposed is not None:
            update = imposed.copy()
            products = [np.einsum("bij,bj->bi", b, update[g]) for b, g in zip(blocks, self.groups, strict=True)]
            residual += self.sum(products)
        update[self.free] = self._solve(blocks, -residual[self.free])
        if not np.isfinite(update).all():
            raise NotConvergedError("the linear system has no finite solution")
        along = np.einsum("ei,ei->e", internal.coupling, update[self.model.dofs])
        return update, np.asarray(rate * (internal.volume + along))

    def _solve(self, blocks: Sequence[Floats], rhs: Floats) -> Floats:
        """Factorise and solve; sparsity and analysis are made once."""
        if self._direct is None:
            assembler = Assembler(self.groups, self.free, self.total, symmetric=True)
            self._direct = assembler, linear_solver(assembler.indptr, assembler.indices, symmetric=True)
        assembler, solver = self._direct
        self.factorisations += 1
        return solver.solve(assembler.values(blocks), rhs)

    def admissible(self, positions: Floats, update: Floats, least: float) -> float:
        """Share of an update, 1 halved as often as needed, that keeps det F above `least` of its smallest value.

        Raises:
            NotConvergedError: even a short step turns an element inside out.
        """
        motion = update[: positions.size].reshape(-1, 3)
        bound = least * self.model.determinants(positions).min()
        step_length = 1.0
        while self.model.determinants(positions + step_length * motion).min() <= bound:
            step_length *= 0.5
            if step_length < SHORTEST_UPDATE:
                raise NotConvergedError("an element turns inside out")
        return step_length


def node_dofs(nodes: Integers) -> Integers:
    """Degrees of freedom (M, 3 k) of nodes (M, k)."""
    return np.asarray((3 * np.asarray(nodes)[:, :, None] + np.arange(3)).reshape(len(nodes), -1))
