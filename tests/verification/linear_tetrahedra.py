"""Static equilibrium of linear tetrahedra with NiftySim's law: what its breast would be if it had come to rest.

Written for the comparison alone: displacements only, one gauss point, so that the elements lock as NiftySim's do. Nodes
in contact stand at the plates; those that a plate would have to pull are let go, those that pass one are taken on.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.linear.direct import linear_solver
from mammoreg.fem.linear.sparse import Assembler
from mammoreg.materials.elastic import bulk_ratio
from tests.verification.niftysim import LOWER_MM, MU_KPA, UPPER_MM, WEIGHT, ChestTurn, PendantBreast

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
ROUNDS, ITERATIONS, CLOSE_MM = 6, 25, 0.02
STANDS = 1e6
"""Stiffness, mN/mm, that keeps a touching node at its plate."""


@dataclass(frozen=True)
class AtRest:
    """Displacement (N, 3), mm; forces of the lower and upper plate, N; force and moment that hold the chest's turn."""

    displacement: Floats
    plates_n: tuple[float, float]
    turn_load: Floats


class TetrahedralBreast:
    """The breast with one Poisson's ratio for all tissues."""

    def __init__(self, body: PendantBreast, poisson: float) -> None:
        self.body, self.count = body, len(body.points)
        corners = body.points[body.tets]
        edges = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
        inverse = np.linalg.inv(edges)
        self.volume = np.abs(np.linalg.det(edges)) / 6.0
        self.slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.mu = MU_KPA[body.tissue]
        self.bulk = self.mu * bulk_ratio(poisson)
        self.dofs = (3 * body.tets[:, :, None] + np.arange(3)).reshape(-1, 12)
        self.weight = np.zeros((self.count, 3))
        np.add.at(self.weight[:, 2], body.tets.ravel(), np.repeat(0.25 * WEIGHT * self.volume, 4))
        self.turn = ChestTurn.of(body.points[body.chest], body.displacement[body.chest])
        self.rows = np.zeros((2, self.count, 3))
        self.rows[:, body.chest] = self.turn.measures.reshape(2, -1, 3)
        self.surface = _surface(body.tets)
        held = np.zeros((self.count, 3), dtype=bool)
        held[body.chest, 1] = True
        self.free = np.flatnonzero(~held.ravel())
        groups = [self.dofs, np.arange(3 * self.count)[:, None]]
        self.assembler = Assembler(groups, self.free, 3 * self.count, symmetric=True)
        self.solver = linear_solver(self.assembler.indptr, self.assembler.indices, symmetric=True)

    def rest(self, start: Floats) -> AtRest:
        """Newton's method from nodes (N, 3) with the chest's shift and turn held as published."""
        positions = start.copy()
        positions[self.body.chest, 1] = self.body.points[self.body.chest, 1]
        height = positions[self.surface, 2]
        low, high = (self.surface[np.abs(height - plate) < 0.05] for plate in (LOWER_MM, UPPER_MM))
        for _ in range(ROUNDS):
            positions, load, moved = self._newton(positions, low, high)
            pull, touching = self._forces(positions)[:, 2], (low, high)
            height = positions[self.surface, 2]
            low = np.union1d(low[pull[low] > 0.0], self.surface[height < LOWER_MM])
            high = np.union1d(high[pull[high] < 0.0], self.surface[height > UPPER_MM])
            if np.array_equal(low, touching[0]) and np.array_equal(high, touching[1]) and moved < CLOSE_MM:
                break
        plates = float(pull[touching[0]].sum()) * 1e-3, float(-pull[touching[1]].sum()) * 1e-3
        return AtRest(positions - self.body.points, plates, load)

    def _newton(self, positions: Floats, low: Indices, high: Indices) -> tuple[Floats, Floats, float]:
        """Nodes at rest with some of them at the plates; load on the chest's turn; largest last update, mm."""
        at_plate, plate = np.zeros((self.count, 3), dtype=bool), positions.copy()
        plate[low, 2], plate[high, 2] = LOWER_MM, UPPER_MM
        at_plate[low, 2] = at_plate[high, 2] = True
        tied, rows = at_plate.ravel()[self.free], self.rows.reshape(2, -1)
        free_rows, damping = np.where(tied, 0.0, np.ascontiguousarray(rows[:, self.free])), 0.3
        for _ in range(ITERATIONS):
            diagonal = (np.where(at_plate.ravel(), STANDS, 0.0) + damping)[:, None, None]
            self.solver.factorise(self.assembler.values([self._stiffness(positions), diagonal]))
            gap = np.where(at_plate, plate - positions, 0.0).ravel()
            force = np.where(tied, STANDS * gap[self.free], -self._forces(positions).ravel()[self.free])
            plain, *answers = (self.solver.back_substitute(rhs) for rhs in (force, *free_rows))
            missing = rows @ (positions - self.body.points).ravel() - self.turn.goal
            load = np.linalg.solve(free_rows @ np.transpose(answers), free_rows @ plain + missing)
            update = np.zeros(3 * self.count)
            update[self.free] = np.where(tied, gap[self.free], plain - load @ np.array(answers))
            settled = bool(np.abs(missing).max() < 1e-6 and np.abs(gap).max() < 1e-6)
            share = self._admissible(positions, update.reshape(-1, 3), settled)
            positions = positions + share * update.reshape(-1, 3)
            moved, damping = float(np.abs(update).max()), damping * (0.1 if share == 1.0 else 3.0)
            if moved < CLOSE_MM:
                break
        return positions, load, moved

    def _admissible(self, positions: Floats, update: Floats, settled: bool) -> float:
        """Share of an update, halved until no element collapses and, once plates and turn stand, the energy falls."""
        most = (1.0 + 1e-6) * self._energy(positions) if settled else np.finfo(float).max
        share = 1.0
        while self._energy(positions + share * update) > most and share > 1e-3:
            share *= 0.5
        return share

    def _energy(self, positions: Floats) -> float:
        """Strain energy less the work of the weight, mN mm; infinite where an element collapses."""
        gradient, _, det = self._gradient(positions)
        if det.min() <= 0.1:
            return np.inf
        size = (gradient**2).sum(axis=(1, 2))
        density = 0.5 * self.mu * (det ** (-2.0 / 3.0) * size - 3.0) + 0.5 * self.bulk * (det - 1.0) ** 2
        return float((self.volume * density).sum() - (self.weight * (positions - self.body.points)).sum())

    def _gradient(self, positions: Floats) -> tuple[Floats, Floats, Floats]:
        """F, its transposed inverse and its determinant of all elements."""
        gradient = np.einsum("eai,eaj->eij", positions[self.body.tets], self.slopes)
        return gradient, np.linalg.inv(gradient).swapaxes(1, 2), np.linalg.det(gradient)

    def _forces(self, positions: Floats) -> Floats:
        """Internal forces less the weight (N, 3), mN."""
        gradient, inverse, det = self._gradient(positions)
        size = (gradient**2).sum(axis=(1, 2))[:, None, None]
        stress = (self.mu * det ** (-2.0 / 3.0))[:, None, None] * (gradient - size / 3.0 * inverse)
        stress += (self.bulk * (det - 1.0) * det)[:, None, None] * inverse
        nodal = np.einsum("eij,eaj,e->eai", stress, self.slopes, self.volume)
        total = -self.weight
        np.add.at(total, self.body.tets, nodal)
        return total

    def _stiffness(self, positions: Floats) -> Floats:
        """Derivative (E, 12, 12) of the elements' forces."""
        gradient, inverse, det = self._gradient(positions)
        scale, size = self.mu * det ** (-2.0 / 3.0), (gradient**2).sum(axis=(1, 2))
        pressure = self.bulk * (det - 1.0) * det
        spatial = np.einsum("eij,eaj->eai", inverse, self.slopes)
        pushed = np.einsum("eij,eaj->eai", gradient, self.slopes)
        mixed = np.einsum("e,eai,ebj->eaibj", -2.0 / 3.0 * scale, pushed, spatial)
        total = mixed + mixed.transpose(0, 3, 4, 1, 2)
        total += np.einsum("e,eac,ebc,ij->eaibj", scale, self.slopes, self.slopes, np.eye(3), optimize=True)
        double = 2.0 / 9.0 * scale * size + pressure + self.bulk * det**2
        total += np.einsum("e,eai,ebj->eaibj", double, spatial, spatial)
        total += np.einsum("e,eaj,ebi->eaibj", scale * size / 3.0 - pressure, spatial, spatial)
        return np.asarray((total * self.volume[:, None, None, None, None]).reshape(-1, 12, 12))


def _surface(tets: Indices) -> Indices:
    """Nodes of the faces that belong to one element only."""
    faces = np.sort(tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    alone, count = np.unique(faces, axis=0, return_counts=True)
    return np.unique(alone[count == 1])
