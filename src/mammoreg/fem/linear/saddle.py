"""Newton updates of large blocks by GMRES on the saddle-point form, preconditioned by a two-grid cycle.

With k = K / V of each element split into g = gamma / V, which stays with the displacements, and the rest,

    [ A + g c c^T    c           ] [du]   [ -f - g c r ]
    [ c^T            -1 / (k - g)] [q ] = [ -r         ]        dp = g (r + c^T du) + q

(f, r: residuals of displacements and pressures, c: their coupling). The augmented displacement block is that of a
compressible body, which a two-grid cycle inverts well however large K is; the Schur complement of the pressures is
close to V / (gamma + mu), a number for each element.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.elements.model import HyperelasticModel, Residual
from mammoreg.fem.linear.hierarchy import Hierarchy
from mammoreg.fem.linear.krylov import fgmres
from mammoreg.fem.linear.multigrid import TwoGrid

RESIDUAL = 3e-3
ITERATIONS = 200
AUGMENTATION = 8.0  # gamma in units of the shear modulus: more helps the pressures and costs the displacements
LARGEST_SHARE = 0.5  # gamma as a share of K, at most
SHEAR_IN_SCHUR = 1.3  # shear moduli in the estimate of the Schur complement
TRACE_OF_CUBE = 0.16875  # mu |c|^2 / (V trace A) of an undeformed cube


class SaddleSystem:
    """Displacements and pressures of a body on a structured block, solved iteratively.

    Args:
        model: the body.
        groups: degrees of freedom (blocks, size) of everything beside its elements.
        free: the unknowns, ascending.
        total: number of degrees of freedom; the nodes' are the first.
        hierarchy: grids of the block.

    Attributes:
        iterations: of GMRES, one number a solve.
    """

    def __init__(
        self, model: HyperelasticModel, groups: Sequence[Integers], free: Integers, total: int, hierarchy: Hierarchy
    ) -> None:
        self._model, self._groups, self._hierarchy, self._total = model, groups, hierarchy, total
        self._free = np.zeros(total, dtype=bool)
        self._free[free] = True
        self._grids = TwoGrid(hierarchy, self._free)
        self.iterations: list[int] = []

    def increment(
        self, internal: Residual, residual: Floats, blocks: Sequence[Floats], imposed: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Update (total,) of the degrees of freedom and (E,) of the pressures.

        Args:
            internal: the elements' residual.
            residual: unbalanced forces (total,), mN, at the present pressures.
            blocks: tangents of the elements (pressures eliminated) and of the groups.
            imposed: increments (total,) of degrees of freedom that are not free.

        Raises:
            NotConvergedError: GMRES does not reach its tolerance, or a grid's matrix is singular.
        """
        self._renew(internal, blocks)
        start = np.zeros(self._total) if imposed is None else imposed
        volume = internal.volume + self._coupling @ start
        force = residual + self._transposed @ (self._augmented * internal.volume)
        if imposed is not None:
            force = force + self._grids.product(start)
        solution = self._solve(np.concatenate([np.where(self._free, -force, 0.0), -volume]))
        update, pressure = start + solution[: self._total], solution[self._total :]
        return update, self._augmented * (internal.volume + self._coupling @ update) + pressure

    def _renew(self, internal: Residual, blocks: Sequence[Floats]) -> None:
        """Take the matrices of a new Newton iteration."""
        coupling, rate, volume = internal.coupling, self._model.bulk_per_volume, self._model.volume
        size = (coupling**2).sum(axis=1)
        trace = np.einsum("eii->e", blocks[0]) - rate * size
        shear = np.maximum(TRACE_OF_CUBE * volume * trace / size, 1e-6 * self._model.material.mu_kpa)
        gamma = np.minimum(AUGMENTATION * shear, LARGEST_SHARE * rate * volume)
        self._augmented = gamma / volume
        self._flexibility = 1.0 / (rate - self._augmented)
        self._schur = self._flexibility + volume / (gamma + SHEAR_IN_SCHUR * shear)
        self._coupling, self._transposed = self._couplings(coupling)
        less = (rate - self._augmented)[:, None] * coupling
        values = self._hierarchy.stencil_values(blocks[0], less, coupling)
        self._grids.renew(values, remainder(self._groups, blocks[1:], self._total))

    def _couplings(self, coupling: Floats) -> tuple[sp.csr_array, sp.csr_array]:
        """The coupling as a matrix (E, total) and its transpose over the unknowns (total, E)."""
        elements = len(coupling)
        start = np.arange(elements + 1, dtype=np.int32) * 24
        columns = self._model.dofs.ravel().astype(np.int32)
        matrix = sp.csr_array((coupling.ravel(), columns, start), shape=(elements, self._total))
        return matrix, sp.csr_array(matrix.T)

    def _solve(self, rhs: Floats) -> Floats:
        """GMRES in units that make both kinds of unknowns alike."""
        scale = np.concatenate([self._grids.scale(), 1.0 / np.sqrt(self._schur)])
        solution, count = fgmres(
            lambda vector: scale * self._apply(vector),
            lambda vector: self._precondition(vector / scale),
            scale * rhs,
            RESIDUAL,
            ITERATIONS,
        )
        self.iterations.append(count)
        return solution

    def _apply(self, vector: Floats) -> Floats:
        update, pressure = vector[: self._total], vector[self._total :]
        force = self._grids.apply(update) + np.where(self._free, self._transposed @ pressure, 0.0)
        return np.concatenate([force, self._coupling @ update - self._flexibility * pressure])

    def _precondition(self, vector: Floats) -> Floats:
        """Block triangular: the pressures by their Schur complement, then the displacements by a cycle."""
        pressure = -vector[self._total :] / self._schur
        force = vector[: self._total] - np.where(self._free, self._transposed @ pressure, 0.0)
        return np.concatenate([self._grids.solve(force), pressure])


def remainder(groups: Sequence[Integers], blocks: Sequence[Floats], total: int) -> sp.csr_array:
    """Sum of blocks (blocks, size, size) as one sparse matrix (total, total); blocks of zeros cost nothing."""
    rows, columns, entries = [], [], []
    for group, block in zip(groups, blocks, strict=True):
        acts = block.any(axis=(1, 2))
        dofs, width = group[acts].astype(np.int32), group.shape[1]
        rows.append(np.repeat(dofs, width, axis=1).ravel())
        columns.append(np.tile(dofs, (1, width)).ravel())
        entries.append(block[acts].ravel())
    if not entries:
        return sp.csr_array((total, total))
    place = (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_array((np.concatenate(entries), place), shape=(total, total))
