"""Hexahedral meshes of the verification problems, in the order that HyperelasticModel takes (VTK)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mammoreg.meshing.trilinear import shape_functions

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Mesh = tuple[Floats, Indices]


def brick(counts: tuple[int, int, int], mapping: Callable[[Floats], Floats] | None = None) -> Mesh:
    """Nodes (N, 3) and hexahedra (E, 8) of the unit cube cut into counts, its points (N, 3) sent through a mapping."""
    nx, ny, nz = counts
    k, j, i = np.meshgrid(np.arange(nz + 1), np.arange(ny + 1), np.arange(nx + 1), indexing="ij")
    points = np.stack([i.ravel() / nx, j.ravel() / ny, k.ravel() / nz], axis=1)
    number = np.arange(len(points)).reshape(nz + 1, ny + 1, nx + 1).transpose(2, 1, 0)
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low), (high, low), (high, high), (low, high)]
    cells = [number[a, b, c].ravel() for c in (low, high) for a, b in corners]
    return (points if mapping is None else mapping(points)), np.stack(cells, axis=1)


def shaken(points: Floats, amount: float, seed: int = 0) -> Floats:
    """Points of the unit cube whose inner ones are moved by up to `amount` in each direction."""
    inner = ((points > 1e-9) & (points < 1.0 - 1e-9)).all(axis=1)
    moved = points.copy()
    moved[inner] += amount * np.random.default_rng(seed).uniform(-1.0, 1.0, (int(inner.sum()), 3))
    return moved


def subdivided(points: Floats, hexes: Indices, pieces: int) -> Mesh:
    """The mesh whose every hexahedron is cut into pieces x pieces x pieces by its own trilinear map."""
    local, cells = brick((pieces, pieces, pieces), lambda unit: 2.0 * unit - 1.0)
    fine = np.einsum("pa,eac->epc", shape_functions(local), points[hexes])
    every = (cells[None] + len(local) * np.arange(len(hexes))[:, None, None]).reshape(-1, 8)
    return merged(fine.reshape(-1, 3), every)


def merged(points: Floats, hexes: Indices, grid: float = 1e-6) -> Mesh:
    """The mesh with nodes at the same place, to a grid in mm, made one."""
    _, first, number = np.unique(
        np.round(points / grid).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[hexes]


def spherical_shell(inner: float, outer: float, across: int, layers: int) -> Mesh:
    """A whole spherical shell from six patches of across x across x layers elements."""
    unit, cells = brick((across, across, layers))
    angles = np.tan(0.5 * np.pi * (unit[:, :2] - 0.5))
    ray = np.stack([angles[:, 0], angles[:, 1], np.ones(len(unit))], axis=1)
    radius = inner + (outer - inner) * unit[:, 2:]
    patch = radius * ray / np.linalg.norm(ray, axis=1, keepdims=True)
    # The six turns that send +z to each of the axes.
    turns = [np.eye(3), np.diag([1.0, -1.0, -1.0])]
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        turn = np.zeros((3, 3))
        turn[axis, 2], turn[2, axis], turn[1 - axis, 1 - axis] = sign, -sign, 1.0
        turns.append(turn)
    points = np.concatenate([patch @ turn.T for turn in turns])
    hexes = np.concatenate([cells + len(patch) * number for number in range(6)])
    return merged(points, hexes, 1e-9 * outer)
