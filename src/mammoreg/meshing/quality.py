"""Quality of a block mesh: Jacobians, volume and distance from the mask's surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.trilinear import CORNERS, GAUSS_POINTS, jacobians, shape_functions, volumes


@dataclass(frozen=True)
class MeshQuality:
    """What a mesh is judged by.

    Attributes:
        min_gauss_jacobian: smallest scaled Jacobian (determinant over the product of column lengths: 1 for a brick,
            <= 0 for an inverted element) at the 2 x 2 x 2 Gauss points.
        min_corner_jacobian: the same at the nodes of each element.
        volume_error: signed share by which the mesh's volume differs from the mask's.
        surface_distance_mean_mm: mean distance between the surfaces of mesh and mask, both ways.
        surface_distance_p95_mm: its 95th percentile.
    """

    min_gauss_jacobian: float
    min_corner_jacobian: float
    volume_error: float
    surface_distance_mean_mm: float
    surface_distance_p95_mm: float


def mesh_quality(mesh: BlockMesh, vertices: Floats, triangles: Integers, volume_mm3: float) -> MeshQuality:
    """Judge a mesh against a mask's surface: vertices (V, 3) in mm, triangles (T, 3), and the mask's volume."""
    nodes = mesh.points[mesh.hexes()]
    distance = surface_distances(mesh, vertices, triangles)
    return MeshQuality(
        min_gauss_jacobian=float(scaled_jacobians(nodes, GAUSS_POINTS).min()),
        min_corner_jacobian=float(scaled_jacobians(nodes, CORNERS).min()),
        volume_error=float(volumes(nodes).sum() / volume_mm3 - 1.0),
        surface_distance_mean_mm=float(distance.mean()),
        surface_distance_p95_mm=float(np.percentile(distance, 95.0)),
    )


def scaled_jacobians(nodes: Floats, local: Floats) -> Floats:
    """Determinant over the product of the columns' lengths, (M, Q), of hexahedra (M, 8, 3) at local (Q, 3)."""
    matrices = jacobians(nodes, local)
    lengths = np.linalg.norm(matrices, axis=2).prod(axis=2)
    return np.asarray(np.linalg.det(matrices) / np.maximum(lengths, 1e-12))


def folded_corners(nodes: Floats) -> NDArray[np.bool_]:
    """Corners (M, 8) of hexahedra (M, 8, 3) at which the Jacobian is not positive."""
    return np.asarray(scaled_jacobians(nodes, CORNERS) <= 0.0)


def surface_distances(mesh: BlockMesh, vertices: Floats, triangles: Integers) -> Floats:
    """Distances in mm from each surface to the other, of points spread evenly over both, all in one array."""
    of_mesh = _sample_quads(mesh.points[np.concatenate([mesh.skin_quads(), mesh.back_quads()])])
    of_mask = vertices[triangles].mean(axis=1)
    to_mask, _ = cKDTree(np.concatenate([vertices, of_mask])).query(of_mesh)
    to_mesh, _ = cKDTree(of_mesh).query(of_mask)
    return np.concatenate([to_mask, to_mesh])


def _sample_quads(corners: Floats, spacing: float = 1.0) -> Floats:
    """Points (P, 3) of bilinear patches with corners (F, 4, 3), about `spacing` mm apart."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    steps = int(np.clip(np.ceil(longest / spacing), 2, 40))
    side = (np.arange(steps) + 0.5) / steps * 2.0 - 1.0
    u, v = np.meshgrid(side, side, indexing="ij")
    local = np.stack([u, v, -np.ones_like(u)], axis=-1).reshape(-1, 3)
    weights = shape_functions(local)[:, :4]
    return np.asarray(np.einsum("pa,fac->fpc", weights, corners, optimize=True)).reshape(-1, 3)
