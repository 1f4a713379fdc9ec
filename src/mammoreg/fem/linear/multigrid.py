"""Two-grid preconditioner of the displacements: Chebyshev smoothing on the fine grid, a direct solve on the coarse one.

The coarse matrix is the Galerkin product with trilinear interpolation by node index. Held components and degrees of
freedom behind the nodes' (the plates' common height, nodes of a skin) are part of both grids.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError
from mammoreg.fem.linear.direct import PardisoSolver, SuperLuSolver, linear_solver
from mammoreg.fem.linear.hierarchy import Hierarchy

DEGREE = 3
SMOOTHED_SHARE = 1.0 / 8.0  # of the spectrum, from its upper end, that the smoother acts on
FIRST_POWER_STEPS, POWER_STEPS = 12, 5  # the later ones start from the last vector
SAFETY = 1.15  # the power iteration finds the largest eigenvalue from below


class TwoGrid:
    """Approximate inverse of (A + R): A the stencil of a block's displacements, R everything else.

    Args:
        hierarchy: the two grids.
        free: which degrees of freedom are unknowns, (total,).
    """

    def __init__(self, hierarchy: Hierarchy, free: NDArray[np.bool_]) -> None:
        self.nodes, self.total = hierarchy.nodes, len(free)
        self.free = free
        self._own = free[: 3 * self.nodes].reshape(-1, 3)
        self._tail = slice(3 * self.nodes, self.total)
        self._down = self._prolongation(hierarchy)
        self._up = sp.csr_array(self._down.T)
        self._indices, self._indptr = hierarchy.stencil(), 27 * np.arange(self.nodes + 1, dtype=np.int32)
        self._power_steps = FIRST_POWER_STEPS
        self._vector = np.where(free, np.random.default_rng(0).standard_normal(self.total), 0.0)

    def _prolongation(self, hierarchy: Hierarchy) -> sp.csr_array:
        """Free degrees of freedom of the coarse grid to all of the fine one, zero at held ones."""
        grids = sp.kron(hierarchy.interpolation(), sp.eye_array(3))
        whole = sp.csr_array(sp.block_diag([grids, sp.eye_array(self.total - 3 * self.nodes)]))
        whole = sp.csr_array(sp.diags_array(self.free.astype(float)) @ whole)
        kept = np.append(self._own[hierarchy.coincident()].ravel(), self.free[self._tail])
        reached = np.asarray(whole.sum(axis=0)) > 0.0
        down = sp.csc_array(whole)[:, np.flatnonzero(kept & reached)]
        down.eliminate_zeros()
        return sp.csr_array(down)

    def renew(self, values: Floats, rest: sp.csr_array) -> None:
        """Take new stencil values (27 nodes, 3, 3) and a new remainder (total, total).

        Raises:
            NotConvergedError: a diagonal block or the coarse matrix is singular.
        """
        size = 3 * self.nodes
        self._stencil = sp.bsr_array((values, self._indices, self._indptr), shape=(size, size))
        self._rest = rest
        self.diagonal = self._diagonal_blocks(values)
        try:
            self._inverse = np.linalg.inv(self.diagonal)
        except np.linalg.LinAlgError as error:
            raise NotConvergedError("a diagonal block of the stiffness is singular") from error
        tail = rest.diagonal()[self._tail]
        self.tail = np.where(self.free[self._tail] & (np.abs(tail) > 0.0), tail, 1.0)
        self._largest = self._largest_eigenvalue()
        self._coarse = self._factor()

    def product(self, vector: Floats) -> Floats:
        """The matrix times a vector (total,)."""
        product = self._rest @ vector
        product[: 3 * self.nodes] += self._stencil @ vector[: 3 * self.nodes]
        return np.asarray(product)

    def apply(self, vector: Floats) -> Floats:
        """The matrix of the unknowns times a vector (total,) that is zero at held components."""
        return np.where(self.free, self.product(vector), 0.0)

    def scale(self) -> Floats:
        """Inverse square root of the diagonal (total,), one number a node; 1 at held components."""
        nodal = np.einsum("nii->n", self.diagonal) / 3.0
        return np.asarray(1.0 / np.sqrt(np.abs(np.append(np.repeat(nodal, 3), self.tail))))

    def solve(self, residual: Floats) -> Floats:
        """One symmetric cycle: smooth, correct on the coarse grid, smooth."""
        change = self._smooth(residual)
        remaining = residual - self.apply(change)
        correction = self._down @ self._coarse.back_substitute(self._up @ remaining)
        return np.asarray(change + correction + self._smooth(remaining - self.apply(correction)))

    def _diagonal_blocks(self, values: Floats) -> Floats:
        """3 x 3 blocks (nodes, 3, 3) of the whole matrix; identity at held components."""
        blocks = values.reshape(self.nodes, 27, 3, 3)[:, 13].copy()
        rest = sp.coo_array(self._rest)
        row, column = rest.coords
        inside = (row // 3 == column // 3) & (row < 3 * self.nodes)
        np.add.at(blocks, (row[inside] // 3, row[inside] % 3, column[inside] % 3), rest.data[inside])
        blocks *= self._own[:, :, None] & self._own[:, None, :]
        blocks[:, range(3), range(3)] += ~self._own
        return np.asarray(blocks)

    def _jacobi(self, vector: Floats) -> Floats:
        scaled = np.empty(self.total)
        nodal = vector[: 3 * self.nodes].reshape(-1, 3, 1)
        scaled[: 3 * self.nodes] = np.matmul(self._inverse, nodal).ravel()
        scaled[self._tail] = vector[self._tail] / self.tail
        return scaled

    def _largest_eigenvalue(self) -> float:
        """Of the Jacobi-scaled matrix, by power iteration from the last one's vector."""
        vector, largest = self._vector, 1.0
        for _ in range(self._power_steps):
            product = self._jacobi(self.apply(vector))
            largest = float(np.linalg.norm(product))
            if not (np.isfinite(largest) and largest > 0.0):
                raise NotConvergedError("the stiffness holds values that are not finite")
            vector = product / largest
        self._vector, self._power_steps = vector, POWER_STEPS
        return SAFETY * largest

    def _smooth(self, residual: Floats) -> Floats:
        """Chebyshev iteration from zero."""
        high, low = self._largest, SMOOTHED_SHARE * self._largest
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio = half / middle
        step = self._jacobi(residual) / middle
        change, remaining = step, residual
        for _ in range(DEGREE - 1):
            remaining = remaining - self.apply(step)
            after = 1.0 / (2.0 * middle / half - ratio)
            step = after * ratio * step + 2.0 * after / half * self._jacobi(remaining)
            change = change + step
            ratio = after
        return np.asarray(change)

    def _factor(self) -> PardisoSolver | SuperLuSolver:
        """The coarse matrix, factorised."""
        tail = sp.csr_array((self.total - 3 * self.nodes,) * 2)
        whole = sp.csr_array(sp.block_diag([self._stencil.tocsr(), tail])) + self._rest
        coarse = sp.csr_array(sp.triu(self._up @ (whole @ self._down)))
        coarse.sort_indices()
        solver = linear_solver(coarse.indptr.astype(np.int32), coarse.indices.astype(np.int32), symmetric=True)
        solver.factorise(coarse.data)
        return solver
