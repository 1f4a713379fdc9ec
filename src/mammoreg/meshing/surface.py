"""The surface of a breast mask, split into skin and back."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from mammoreg.arrays import Floats, Integers
from mammoreg.errors import DataError
from mammoreg.geometry import Volume

_NORMAL_WEIGHT_MM = 12.0
_SMOOTHING_VOXELS = 0.9


@dataclass(frozen=True)
class OrientedCloud:
    """Points of a surface with unit outward normals; answers which tangent plane belongs to a place.

    Attributes:
        points: positions (N, 3), mm.
        normals: unit normals (N, 3).
    """

    points: Floats
    normals: Floats
    _tree: cKDTree = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        keys = np.hstack([self.points, _NORMAL_WEIGHT_MM * self.normals])
        object.__setattr__(self, "_tree", cKDTree(keys))

    def tangent_planes(self, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """A point and the normal, each (N, 3), of the surface near points whose own normals are like it.

        The normal counts in the search so that the two walls of a fold do not attract each other's nodes.
        """
        _, nearest = self._tree.query(np.hstack([points, _NORMAL_WEIGHT_MM * normals]))
        return self.points[nearest], self.normals[nearest]


@dataclass(frozen=True)
class BreastSurface:
    """The triangulated surface of a mask in the breast frame, mm.

    Attributes:
        vertices: (V, 3).
        normals: unit outward normals at the vertices (V, 3).
        triangles: all triangles (T, 3), outward.
        skin_triangles: those of the skin: one connected piece whose border is the back's rim.
        skin: cloud of the skin, without the vertices that smoothing has rounded off at the rim.
        back: cloud of the chest-wall surface.
        volume_mm3: volume of the mask.
    """

    vertices: Floats
    normals: Floats
    triangles: Integers
    skin_triangles: Integers
    skin: OrientedCloud
    back: OrientedCloud
    volume_mm3: float


def breast_surface(mask: Volume, chest_wall_surface: Floats) -> BreastSurface:
    """Triangulate a mask and tell its skin from its back.

    Args:
        mask: non-zero inside the breast, breast frame.
        chest_wall_surface: points (N, 3) on the mask's back, mm.

    Raises:
        DataError: the mask is empty, or too little of its surface is skin or back.
    """
    vertices, triangles = triangulate(mask)
    normals = _vertex_normals(vertices, triangles)
    voxel = float(mask.spacing.max())
    back = _back_cloud(chest_wall_surface, vertices.mean(axis=0))
    height, alignment = _relation_to_back(vertices, normals, back)
    is_back = _smooth_labels((np.abs(height) < 3.0 * voxel) & (alignment > 0.5), triangles)
    skin_triangles = _largest_piece(triangles[~is_back[triangles].any(axis=1)])
    if len(skin_triangles) < 200 or is_back.sum() < 50:
        raise DataError(
            "the breast mask's surface does not split into skin and back: check that the chest-wall surface lies on it"
        )
    on_skin = np.unique(skin_triangles)
    sharp = on_skin[height[on_skin] < -1.5 * voxel]
    skin = OrientedCloud(vertices[sharp], normals[sharp])
    inside = float((mask.data > 0).sum()) * mask.voxel_mm3
    return BreastSurface(vertices, normals, triangles, skin_triangles, skin, back, inside)


def triangulate(mask: Volume) -> tuple[Floats, Integers]:
    """Surface of a mask as vertices (V, 3) in mm and outward triangles (T, 3), sub-voxel by light smoothing."""
    if not np.any(mask.data):
        raise DataError("the breast mask is empty: check the segmentation's label picture")
    padded = np.pad((mask.data > 0).astype(np.float32), 4)
    smooth = ndimage.gaussian_filter(padded, _SMOOTHING_VOXELS)
    vertices, triangles, _, _ = marching_cubes(smooth, 0.5, gradient_direction="ascent")
    corners = vertices[triangles]
    signed = np.einsum("tc,tc->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    if signed < 0:
        triangles = triangles[:, ::-1]
    return mask.to_world(vertices.astype(float) - 4.0), _largest_piece(triangles.astype(np.int64))


def _vertex_normals(vertices: Floats, triangles: Integers) -> Floats:
    corners = vertices[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], area)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12))


def _back_cloud(points: Floats, middle: Floats, neighbours: int = 25) -> OrientedCloud:
    """Chest-wall points with the normals of their neighbourhoods' best planes, away from the breast's middle."""
    points = np.asarray(points, dtype=float)
    if len(points) < neighbours:
        raise DataError(f"the chest-wall surface has {len(points)} points; at least {neighbours} are needed")
    _, near = cKDTree(points).query(points, k=neighbours)
    local = points[near] - points[near].mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nka,nkb->nab", local, local))
    normals = vectors[:, :, 0]
    away = points.mean(axis=0) - middle
    return OrientedCloud(points, normals * np.where(normals @ away < 0, -1.0, 1.0)[:, None])


def _relation_to_back(vertices: Floats, normals: Floats, back: OrientedCloud) -> tuple[Floats, Floats]:
    """Height (V,) above the back's tangent planes (negative in front) and cosine between the normals (V,)."""
    _, near = cKDTree(back.points).query(vertices, k=8)
    plane = back.normals[near].mean(axis=1)
    plane /= np.linalg.norm(plane, axis=1, keepdims=True)
    height = np.einsum("vc,vc->v", vertices - back.points[near].mean(axis=1), plane)
    return height, np.einsum("vc,vc->v", normals, plane)


def _smooth_labels(label: NDArray[np.bool_], triangles: Integers, rounds: int = 6) -> NDArray[np.bool_]:
    """Majority over neighbours, several times, so that the border between the labels has no teeth."""
    adjacency = vertex_adjacency(triangles, len(label))
    average = sparse.diags_array(1.0 / np.maximum(adjacency.sum(axis=1), 1.0)) @ adjacency
    value = label.astype(float)
    for _ in range(rounds):
        value = 0.5 * (value + average @ value)
    return np.asarray(value > 0.5)


def vertex_adjacency(triangles: Integers, count: int) -> sparse.csr_array:
    """Symmetric matrix (count, count) with 1 for each edge of the triangles (T, 3)."""
    first, second = triangle_edges(triangles).T
    half = sparse.coo_array((np.ones(len(first)), (first, second)), shape=(count, count)).tocsr()
    both = sparse.csr_array(half + half.T)
    both.data[:] = 1.0
    return both


def triangle_edges(triangles: Integers) -> Integers:
    """Directed edges (3 T, 2) of triangles (T, 3)."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _largest_piece(triangles: Integers) -> Integers:
    """The triangles of the largest connected piece."""
    if not len(triangles):
        return triangles
    _, piece = connected_components(vertex_adjacency(triangles, int(triangles.max()) + 1), directed=False)
    owner = piece[triangles[:, 0]]
    return np.asarray(triangles[owner == np.bincount(owner).argmax()])
