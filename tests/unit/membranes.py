"""Flat and round membranes for tests."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.parts.part import Part

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def sheet(n: int, size: float = 40.0, amount: float = 0.0, seed: int = 0) -> tuple[Floats, Indices]:
    """A square sheet of n x n quadrilaterals in the plane z = 0, its inner nodes shifted by a share of a side."""
    j, i = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    points = np.stack([i.ravel(), j.ravel(), 0 * i.ravel()], axis=1) * (size / n)
    inner = (points[:, :2] > 1e-9).all(axis=1) & (points[:, :2] < size - 1e-9).all(axis=1)
    shift = np.random.default_rng(seed).uniform(-1.0, 1.0, (int(inner.sum()), 2))
    points[inner, :2] += amount * size / n * shift
    return points, _quads(np.arange((n + 1) ** 2).reshape(n + 1, n + 1).T)


def tube(around: int, along: int, radius: float, length: float) -> tuple[Floats, Indices]:
    """A circular tube about the z axis with outward faces; node `around` * row + place."""
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    heights = np.linspace(0.0, length, along + 1)
    points = np.concatenate([np.column_stack([ring, np.full(around, z)]) for z in heights])
    grid = np.arange(points.shape[0]).reshape(along + 1, around)
    return points, _quads(np.vstack([grid.T, grid.T[:1]]))


def assembled(part: Part, positions: Floats) -> tuple[Floats, Floats]:
    """Residual (3 N,) and dense stiffness (3 N, 3 N) of a part."""
    force, blocks = part.terms(positions)
    total, dofs = positions.size, part.dofs
    residual, stiffness = np.zeros(total), np.zeros((total, total))
    np.add.at(residual, dofs.ravel(), force.ravel())
    np.add.at(stiffness, (dofs[:, :, None], dofs[:, None, :]), blocks)
    return residual, stiffness


def relaxed(parts: tuple[Part, ...], start: Floats, free: NDArray[np.bool_], rounds: int = 6) -> tuple:
    """Equilibrium of parts over free components (N, 3), by Newton's method with parts renewed between rounds."""
    positions, index = start.copy(), np.flatnonzero(free.ravel())
    for _ in range(rounds):
        for _ in range(30):
            sums = [assembled(part, positions) for part in parts]
            residual, stiffness = (sum(terms) for terms in zip(*sums, strict=True))
            update = np.linalg.solve(stiffness[np.ix_(index, index)], -residual[index])
            positions.ravel()[index] += update
            if np.abs(update).max() < 1e-9:
                break
        parts = tuple(part.renewed(positions) for part in parts)
    return positions, parts


def assert_energy_force_and_stiffness_agree(part: Part, positions: Floats, tolerance: float = 1e-6) -> None:
    """Force is the energy's gradient and stiffness the force's, by central differences in random directions."""
    residual, stiffness = assembled(part, positions)
    np.testing.assert_allclose(stiffness, stiffness.T, atol=1e-10 * np.abs(stiffness).max())
    rng, step = np.random.default_rng(3), 1e-5
    for _ in range(4):
        motion = rng.normal(size=positions.shape)
        ahead, behind = positions + step * motion, positions - step * motion
        work = 1e3 * (part.energy_mj(ahead) - part.energy_mj(behind)) / (2.0 * step)
        change = (assembled(part, ahead)[0] - assembled(part, behind)[0]) / (2.0 * step)
        np.testing.assert_allclose(residual @ motion.ravel(), work, rtol=tolerance, atol=tolerance)
        expected = stiffness @ motion.ravel()
        np.testing.assert_allclose(change, expected, atol=tolerance * np.abs(expected).max())


def _quads(grid: Indices) -> Indices:
    """Faces of nodes [u, v], their normals along u x v."""
    corners = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    return np.stack([corner.ravel() for corner in corners], axis=1)
