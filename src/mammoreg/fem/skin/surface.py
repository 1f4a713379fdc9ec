"""A surface of bilinear quadrilaterals, onto which nodes of a skin around it are projected.

The projection is along the surface's own interpolated nodal normals: unlike the closest point it is continuous across
the edges of faces, so that skin that slides over an edge feels no jump. Partners are sought among the faces around the
last one only: skin slides, it does not leap to another fold of the breast.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.geometry.quads import node_area_vectors

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NEWTON_STEPS = 8
WALKS = 3
"""How often the search goes on around a better face: skin that has slid over more faces within a step."""


@dataclass(frozen=True)
class NearestPoints:
    """Feet of points on the surface.

    Attributes:
        face: number of the face (M,).
        shape: weights (M, 4) of its corners at the foot.
        normal: outward unit normal (M, 3) there.
    """

    face: Integers
    shape: Floats
    normal: Floats


class QuadSurface:
    """Faces (F, 4), outward by their corners' order.

    Attributes:
        quads: their nodes.
        around: for each face, itself and the faces that share a node with it (F, R), padded with itself.
    """

    def __init__(self, quads: NDArray[np.integer]) -> None:
        self.quads: Integers = np.asarray(quads, dtype=np.int64)
        self.around = _faces_around(self.quads)

    def faces_of(self, nodes: Integers) -> tuple[Integers, Floats]:
        """A face (M,) that holds each node (M,), and the corners' weights (M, 4) there, 1 at the node."""
        flat = self.quads.ravel()
        order = np.argsort(flat, kind="stable")
        place = order[np.searchsorted(flat[order], nodes)]
        return place // 4, np.eye(4)[place % 4]

    def areas(self, positions: Floats) -> Floats:
        """Area vectors (N, 3), mm2, that nodes share of the faces around them."""
        return node_area_vectors(positions, self.quads)

    def normals(self, positions: Floats) -> Floats:
        """Unit normals (N, 3) at the surface's nodes, zero elsewhere."""
        areas = self.areas(positions)
        size = np.linalg.norm(areas, axis=1, keepdims=True)
        return np.asarray(areas / np.where(size > 0.0, size, 1.0))

    def normal_at(self, positions: Floats, face: Integers, shape: Floats) -> Floats:
        """Unit normals (M, 3) at places on faces."""
        return _unit(np.einsum("ma,mai->mi", shape, self.normals(positions)[self.quads[face]]))

    def project(self, points: Floats, positions: Floats, last: Integers) -> NearestPoints:
        """Feet of points (M, 3) on the surface with nodes at positions (N, 3), sought around the faces `last` (M,)."""
        normals, face = self.normals(positions), last
        for _ in range(WALKS):
            candidates = self.around[face]
            quads = self.quads[candidates]
            local, height = _feet(points, positions[quads], normals[quads])
            outside = np.abs(local).max(axis=-1) - 1.0
            # Among the faces that hold the foot the nearest, else the one that misses it least.
            badness = np.where(outside > 1e-6, 1e6 * (1.0 + np.minimum(outside, 1e3)), np.abs(height))
            best = np.argmin(badness, axis=1)
            rows = np.arange(len(points))
            found = candidates[rows, best]
            if np.array_equal(found, face):
                break
            face = found
        shape = _shape_functions(np.clip(local[rows, best], -1.0, 1.0))
        return NearestPoints(found, shape, self.normal_at(positions, found, shape))


def _feet(points: Floats, corners: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Local coordinates (M, R, 2) and heights (M, R), mm, at which point = foot + height * normal(foot)."""
    local = np.zeros((*corners.shape[:2], 2))
    height = np.zeros(corners.shape[:2])
    for _ in range(NEWTON_STEPS):
        shape, slopes = _shape_functions(local), _slopes(local)
        foot, normal = _weighted(shape, corners), _weighted(shape, normals)
        tangent = np.einsum("mrad,mrai->mrid", slopes, corners + height[..., None, None] * normals)
        miss = points[:, None] - foot - height[..., None] * normal
        across = np.cross(tangent[..., 0], tangent[..., 1])
        volume = np.einsum("mri,mri->mr", across, normal)
        volume = np.where(np.abs(volume) > 1e-12, volume, 1e-12)
        along = np.einsum("mri,mri->mr", np.cross(tangent[..., 1], normal), miss) / volume
        beside = np.einsum("mri,mri->mr", np.cross(normal, tangent[..., 0]), miss) / volume
        # A face far off need not be met: three of its own widths say that it is not the one.
        local = np.clip(local + np.stack([along, beside], axis=-1), -3.0, 3.0)
        height = height + np.einsum("mri,mri->mr", across, miss) / volume
    return local, height * np.linalg.norm(_weighted(_shape_functions(local), normals), axis=-1)


def _weighted(shape: Floats, values: Floats) -> Floats:
    return np.asarray(np.einsum("mra,mrai->mri", shape, values))


def _shape_functions(local: Floats) -> Floats:
    """Bilinear shape functions (..., 4)."""
    return np.asarray(0.25 * (1.0 + local[..., 0, None] * CORNERS[:, 0]) * (1.0 + local[..., 1, None] * CORNERS[:, 1]))


def _slopes(local: Floats) -> Floats:
    """Their derivatives (..., 4, 2)."""
    along = 0.25 * CORNERS[:, 0] * (1.0 + local[..., 1, None] * CORNERS[:, 1])
    across = 0.25 * CORNERS[:, 1] * (1.0 + local[..., 0, None] * CORNERS[:, 0])
    return np.stack([along, across], axis=-1)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _faces_around(quads: Integers) -> Integers:
    holders: dict[int, list[int]] = {}
    for face, corners in enumerate(quads):
        for node in corners:
            holders.setdefault(int(node), []).append(face)
    rings = [sorted({other for node in corners for other in holders[int(node)]}) for corners in quads]
    width = max(len(ring) for ring in rings)
    return np.array([ring + [face] * (width - len(ring)) for face, ring in enumerate(rings)], dtype=np.int64)
