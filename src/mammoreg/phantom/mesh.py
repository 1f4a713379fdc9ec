"""Hexahedral mesh of a digital patient's breast, laid out unlike the registration's.

A half ball is cut into a cube at its middle and five shells around it, and carried onto the parametric breast along
its bent axis. No element has two faces in one smooth piece of skin, so none flattens.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.phantom.shape import Array, BreastShape

CORE_SHARE = 0.5
AXIS_SHARE = 0.62
BACK_FACES = ([0, 3, 2, 1], [0, 1, 5, 4])
"""Corners of a cell's faces that can lie on the back: below (middle block), at the side (shells)."""


@dataclass(frozen=True)
class PhantomMesh:
    """Nodes and cells of the truth's mesh in the breast frame.

    Attributes:
        points: nodes (N, 3), mm.
        hexes: cells (E, 8), VTK order, positive volume.
        back: node numbers on the surface that is tied to the chest.
        back_quads: faces (B, 4) there.
        skin_quads: outer faces (F, 4), normals outwards.
    """

    points: Array
    hexes: NDArray[np.int64]
    back: NDArray[np.int64]
    back_quads: NDArray[np.int64]
    skin_quads: NDArray[np.int64]


def breast_mesh(shape: BreastShape, core: int, rows: int, shells: int) -> PhantomMesh:
    """Mesh a breast.

    Args:
        shape: the breast.
        core: cells of the middle block across the breast, both ways.
        rows: its cells from back to front.
        shells: layers between it and the skin.
    """
    ball, hexes, skin = _half_ball(core, rows, shells)
    points = _onto_breast(shape, ball)
    on_back = ball[:, 2] < 1e-9
    faces = np.concatenate([hexes[:, corners] for corners in BACK_FACES])
    return PhantomMesh(points, hexes, np.flatnonzero(on_back), faces[on_back[faces].all(axis=1)], skin)


def _half_ball(core: int, rows: int, shells: int) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Nodes of a unit half ball (X medial, Y superior, Z front), cells and outer faces."""
    corners = [_core_cells(core, rows)]
    outer = []
    for side in range(5):
        cells, faces = _shell_cells(core, rows, shells, side)
        corners.append(cells)
        outer.append(faces)
    coords = np.concatenate(corners)
    every = np.concatenate([coords.reshape(-1, 3), np.concatenate(outer).reshape(-1, 3)])
    keys, index = np.unique(np.round(every, 7), axis=0, return_inverse=True)
    index = index.reshape(-1).astype(np.int64)
    hexes = index[: 8 * len(coords)].reshape(-1, 8)
    skin = index[8 * len(coords) :].reshape(-1, 4)
    return np.asarray(keys, dtype=float) + 0.0, hexes, skin


def _core_point(a: Array, b: Array, c: Array) -> Array:
    """Point of the middle block, its sides slightly bulged; a, b in [-1, 1], c in [0, 1]."""
    cube = np.stack([a, b, c], axis=-1)
    length = np.linalg.norm(cube, axis=-1, keepdims=True)
    biggest = np.abs(cube).max(axis=-1, keepdims=True)
    bulge = np.divide(biggest, length, out=np.ones_like(length), where=length > 0.0)
    return np.asarray(CORE_SHARE * cube * (0.6 + 0.4 * bulge) * 1.15)


def _core_cells(core: int, rows: int) -> Array:
    """Corner positions (E, 8, 3) of the middle block's cells."""
    across = np.arange(core) * 2.0 / core - 1.0
    a, b, c = (g.ravel()[:, None] for g in np.meshgrid(across, across, np.arange(rows) / rows, indexing="ij"))
    da = np.array([0, 1, 1, 0, 0, 1, 1, 0]) * 2.0 / core
    db = np.array([0, 0, 1, 1, 0, 0, 1, 1]) * 2.0 / core
    dc = np.array([0, 0, 0, 0, 1, 1, 1, 1]) / rows
    return _core_point(a + da, b + db, c + dc)


def _face_point(side: int, u: Array, v: Array) -> Array:
    """Point of the cube's surface on one of five sides; u in [-1, 1], v in [0, 1] (front: [-1, 1])."""
    one = np.ones_like(u + v)
    u, v = u * one, v * one
    return [
        np.stack([one, u, v], -1),
        np.stack([-u, one, v], -1),
        np.stack([-one, -u, v], -1),
        np.stack([u, -one, v], -1),
        np.stack([u, v, one], -1),
    ][side]


def _shell_cells(core: int, rows: int, shells: int, side: int) -> tuple[Array, Array]:
    """Cells (E, 8, 3) between the middle block's side and the sphere, and their outer faces (F, 4, 3)."""
    u = np.arange(core) * 2.0 / core - 1.0
    v = u if side == 4 else np.arange(rows) / rows
    w = np.arange(shells) / shells
    u, v, w = (g.ravel()[:, None] for g in np.meshgrid(u, v, w, indexing="ij"))
    du = np.array([0, 1, 1, 0, 0, 1, 1, 0]) * 2.0 / core
    dv = np.array([0, 0, 1, 1, 0, 0, 1, 1]) * (2.0 / core if side == 4 else 1.0 / rows)
    dw = np.array([0, 0, 0, 0, 1, 1, 1, 1]) / shells
    cells = _shell_point(side, u + du, v + dv, w + dw)
    outermost = np.isclose(w[:, 0] + 1.0 / shells, 1.0)
    return cells, cells[outermost][:, 4:]


def _shell_point(side: int, u: Array, v: Array, w: Array) -> Array:
    """Point between the middle block (w = 0) and the unit sphere (w = 1)."""
    face = _face_point(side, u, v)
    inner = _core_point(face[..., 0], face[..., 1], face[..., 2])
    even = np.tan(np.pi / 4.0 * face)
    outer = even / np.linalg.norm(even, axis=-1, keepdims=True)
    return np.asarray(inner + w[..., None] * (outer - inner))


def _onto_breast(shape: BreastShape, ball: Array) -> Array:
    """Carry points (N, 3) of the unit half ball into the breast."""
    radius = np.linalg.norm(ball, axis=1)
    direction = ball / np.maximum(radius, 1e-12)[:, None]
    foot = _axis_point(shape, direction[:, 2])
    surface = _surface_point(shape, direction)
    inside: Array = _axis_point(shape, ball[:, 2]) + radius[:, None] * (surface - foot)
    return np.where(ball[:, 2:] < 1e-9, _on_back(shape, inside), inside)


def _axis_point(shape: BreastShape, z: Array) -> Array:
    """Where the rays of a half ball's height z start: on the axis, the back's middle for z = 0."""
    start = shape.back_lift / shape.length
    return shape.axis(start + AXIS_SHARE * (1.0 - start) * z)


def _on_back(shape: BreastShape, points: Array) -> Array:
    return np.column_stack([points[:, 0], shape.back(points[:, 0], points[:, 2]), points[:, 2]])


def _surface_point(shape: BreastShape, direction: Array) -> Array:
    """First point (N, 3) of the skin along each ray; rays at the equator follow the back's surface."""
    low = np.zeros(len(direction))
    high = np.full(len(direction), 0.0)
    step = 4.0
    growing = np.ones(len(direction), dtype=bool)
    for _ in range(60):
        high = np.where(growing, high + step, high)
        inside = shape.level(*_ray_point(shape, direction, high).T) > 0.0
        low = np.where(inside & growing, high, low)
        growing &= inside
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = shape.level(*_ray_point(shape, direction, middle).T) > 0.0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return _ray_point(shape, direction, 0.5 * (low + high))


def _ray_point(shape: BreastShape, direction: Array, distance: Array) -> Array:
    """Points (N, 3) at a distance in mm along the rays of directions (N, 3)."""
    start = _axis_point(shape, direction[:, 2])
    m = start[:, 0] + distance * direction[:, 0]
    s = start[:, 2] + distance * direction[:, 1]
    follow = (1.0 - direction[:, 2]) ** 2
    bend = follow * (shape.back(m, s) - shape.back(start[:, 0], start[:, 2]))
    p = start[:, 1] + bend - distance * direction[:, 2]
    return np.column_stack([m, p, s])
