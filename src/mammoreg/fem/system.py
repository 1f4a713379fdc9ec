"""The linear system of one Newton iteration: blocks of elements and supports, pressures eliminated."""

from collections.abc import Sequence

import numpy as np

from mammoreg.errors import NotConvergedError
from mammoreg.fem.linear import linear_solver
from mammoreg.fem.model import HyperelasticModel, Residual
from mammoreg.fem.sparse import Array, Assembler, Integers

SHORTEST_UPDATE = 1.0 / 16.0


class NewtonSystem:
    """Degrees of freedom, sparsity and solver of a body; the blocks of the elements come first.

    Args:
        model: the body.
        groups: degrees of freedom (blocks, size) of further blocks (springs, contact, ...), symmetric ones.
        free: the unknowns, ascending.
        total: number of degrees of freedom; the nodes' are the first.
    """

    def __init__(self, model: HyperelasticModel, groups: Sequence[Integers], free: Integers, total: int) -> None:
        self.model, self.free, self.total = model, free, total
        self.groups = [model.dofs, *groups]
        self._index = np.concatenate([group.ravel() for group in self.groups])
        self._assembler = Assembler(self.groups, free, total, symmetric=True)
        self._solver = linear_solver(self._assembler.indptr, self._assembler.indices, symmetric=True)

    def sum(self, vectors: Sequence[Array]) -> Array:
        """Assemble block vectors, one array per group, over all degrees of freedom (total,)."""
        flat = np.concatenate([vector.ravel() for vector in vectors])
        return np.asarray(np.bincount(self._index, weights=flat, minlength=self.total), dtype=float)

    def unbalance(self, vectors: Sequence[Array]) -> float:
        """Ratio of unbalanced to internal forces."""
        scale = float(np.linalg.norm(self.sum([np.abs(vector) for vector in vectors])))
        return float(np.linalg.norm(self.sum(vectors)[self.free])) / max(scale, 1e-12)

    def increment(
        self, internal: Residual, vectors: Sequence[Array], blocks: Sequence[Array], imposed: Array | None = None
    ) -> tuple[Array, Array]:
        """Newton update (total,) of the degrees of freedom and (E,) of the pressures.

        Args:
            internal: the elements' residual; its `force` is the first of `vectors`.
            vectors, blocks: residual and tangent of each group; the elements' with pressures eliminated.
            imposed: increments (total,) of degrees of freedom that are not free.

        Raises:
            NotConvergedError: the matrix is singular.
        """
        rate = self.model.bulk_per_volume
        correction = (rate * internal.volume)[:, None] * internal.coupling
        residual = self.sum([vectors[0] + correction, *vectors[1:]])
        update = np.zeros(self.total)
        if imposed is not None:
            update = imposed.copy()
            products = [np.einsum("bij,bj->bi", b, update[g]) for b, g in zip(blocks, self.groups, strict=True)]
            residual += self.sum(products)
        update[self.free] = self._solver.solve(self._assembler.values(blocks), -residual[self.free])
        if not np.isfinite(update).all():
            raise NotConvergedError("the linear system has no finite solution")
        along = np.einsum("ei,ei->e", internal.coupling, update[self.model.dofs])
        return update, np.asarray(rate * (internal.volume + along))

    def admissible(self, positions: Array, update: Array, least: float) -> float:
        """Share of an update, 1 halved as often as needed, that keeps det F above `least` of its smallest value.

        Raises:
            NotConvergedError: even a small share turns an element inside out.
        """
        motion = update[: positions.size].reshape(-1, 3)
        bound = least * self.model.determinants(positions).min()
        share = 1.0
        while self.model.determinants(positions + share * motion).min() <= bound:
            share *= 0.5
            if share < SHORTEST_UPDATE:
                raise NotConvergedError("an element turns inside out")
        return share


def node_dofs(nodes: Integers) -> Integers:
    """Degrees of freedom (M, 3 k) of nodes (M, k)."""
    return np.asarray((3 * np.asarray(nodes)[:, :, None] + np.arange(3)).reshape(len(nodes), -1))
