"""Quadratic terms of the relaxation: fit of the faces to the surface, evenness of the grid lines."""

import numpy as np
from scipy import sparse

from mammoreg.arrays import Floats, Integers
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.relax import SquaredTerms
from mammoreg.meshing.surface import BreastSurface, OrientedCloud
from mammoreg.meshing.trilinear import shape_functions, shape_gradients

# All chosen: how much each squared term counts.
_FIT_WEIGHT = 30.0
_CURVING_WEIGHT = 1.0
_KINK_WEIGHT = 10.0
_ANCHOR_WEIGHT = 3.0


def surface_fit(mesh: BlockMesh, surface: BreastSurface) -> SquaredTerms:
    """Mean squared distance, mm2, of points of the faces from the surface's tangent planes near them.

    The faces themselves are fitted, not the nodes: chords then lie as much outside as inside, and volume is kept.
    Nodes stay free to slide; the back's rim ends up where the extended skin meets the extended back.
    """
    skin = _face_fit(mesh, mesh.skin_quads(), surface.skin)
    back = _face_fit(mesh, mesh.back_quads(), surface.back)
    return SquaredTerms.stack([skin, back]).scaled(_FIT_WEIGHT / (len(skin.offset) + len(back.offset)))


def evenness(mesh: BlockMesh, cell: Floats) -> SquaredTerms:
    """Squared second and third differences along all grid lines, relative to the ideal cell's edges (3,), mm."""
    grid = mesh.node_grid()
    curving, kinks = np.array([1.0, -2.0, 1.0]), np.array([-1.0, 3.0, -3.0, 1.0])
    terms = []
    for axis in range(3):
        for stencil, weight in ((curving, _CURVING_WEIGHT), (kinks, _KINK_WEIGHT)):
            term = _differences(grid, axis, stencil)
            terms.append(term.scaled(weight * 3.0 / (len(term.offset) * cell[axis] ** 2)))
    return SquaredTerms.stack(terms)


def anchor(mesh: BlockMesh, cell: Floats) -> SquaredTerms:
    """Mean squared distance of the nodes from where they are, relative to the ideal cell's edges (3,), mm.

    Sliding along the skin costs next to nothing otherwise, and a small change of the mask could move nodes far.
    """
    matrix = sparse.csr_array(sparse.eye_array(mesh.points.size))
    weight = _ANCHOR_WEIGHT / (len(mesh.points) * float((cell**2).mean()))
    return SquaredTerms(matrix, mesh.points.ravel()).scaled(weight)


def _differences(grid: Integers, axis: int, stencil: Floats) -> SquaredTerms:
    """Finite differences of the node positions along one axis of the block."""
    runs = grid.shape[axis] - len(stencil) + 1
    nodes = np.stack([grid.take(range(s, s + runs), axis=axis).ravel() for s in range(len(stencil))], axis=1)
    rows = np.broadcast_to(np.arange(len(nodes))[:, None], nodes.shape)
    values = np.broadcast_to(stencil, nodes.shape)
    shape = (len(nodes), grid.size)
    scalar = sparse.coo_array((values.ravel(), (rows.ravel(), nodes.ravel())), shape=shape).tocsr()
    matrix = sparse.csr_array(sparse.kron(scalar, sparse.eye_array(3)))
    return SquaredTerms(matrix, np.zeros(matrix.shape[0]))


def _face_fit(mesh: BlockMesh, quads: Integers, cloud: OrientedCloud) -> SquaredTerms:
    """Distances of 3 x 3 points of each quadrilateral from the tangent planes of a cloud."""
    side = np.array([-2.0, 0.0, 2.0]) / 3.0
    u, v = np.meshgrid(side, side, indexing="ij")
    local = np.stack([u, v, -np.ones_like(u)], axis=-1).reshape(-1, 3)
    weights = shape_functions(local)[:, :4]
    points, normals = _on_quads(mesh.points[quads], weights, shape_gradients(local)[:, :4, :2])
    foot, plane = cloud.tangent_planes(points, normals)
    count, per_quad = len(quads), len(local)
    values = np.einsum("pa,fpc->fpac", weights, plane.reshape(count, per_quad, 3))
    columns = np.broadcast_to(3 * quads[:, None, :, None] + np.arange(3), values.shape)
    rows = np.broadcast_to(np.arange(count * per_quad).reshape(count, per_quad, 1, 1), values.shape)
    shape = (count * per_quad, mesh.points.size)
    matrix = sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()
    return SquaredTerms(matrix, (foot * plane).sum(axis=1))


def _on_quads(corners: Floats, weights: Floats, gradients: Floats) -> tuple[Floats, Floats]:
    """Points and unit normals, each (F P, 3), of bilinear patches with corners (F, 4, 3)."""
    points = np.einsum("pa,fac->fpc", weights, corners).reshape(-1, 3)
    tangents = np.einsum("pad,fac->dfpc", gradients, corners).reshape(2, -1, 3)
    normals = np.cross(tangents[0], tangents[1])
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
