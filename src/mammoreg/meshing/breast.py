"""Meshing of a breast by a hexahedral block (paper, section II-A)."""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError
from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.fit import anchor, evenness, surface_fit
from mammoreg.meshing.layout import first_mesh
from mammoreg.meshing.meridians import skin_meridians
from mammoreg.meshing.quality import MeshQuality, mesh_quality
from mammoreg.meshing.relax import SquaredTerms, relax
from mammoreg.meshing.surface import BreastSurface, breast_surface

_ROUNDS = 10
_ITERATIONS_A_ROUND = 40


@dataclass(frozen=True)
class BreastMesh:
    """A breast's block mesh in the breast frame, and how good it is."""

    mesh: BlockMesh
    quality: MeshQuality


def build_mesh(mask: Volume, chest_wall_surface: Floats, nipple: Floats, n: int) -> BreastMesh:
    """Mesh a breast by n x n x n hexahedra whose back lies on the chest wall and whose cap surrounds the front.

    Args:
        mask: non-zero inside the breast, breast frame.
        chest_wall_surface: points (N, 3) in mm on the back of the mask.
        nipple: position (3,) in mm.
        n: elements a side, at least 3.

    Raises:
        DataError: mask or chest-wall surface cannot be meshed.
        NotConvergedError: an element stays inverted.
    """
    if n < 3:
        raise ValueError(f"a block needs at least 3 elements a side, got {n}")
    surface = breast_surface(mask, chest_wall_surface)
    mesh = relax_on_surface(first_mesh(skin_meridians(surface, nipple), n), surface)
    quality = mesh_quality(mesh, surface.vertices, surface.triangles, surface.volume_mm3)
    if quality.min_gauss_jacobian <= 0.0:
        raise NotConvergedError(
            f"the {n} x {n} x {n} mesh has an inverted element (scaled Jacobian {quality.min_gauss_jacobian:.3f}): "
            "check the breast mask, or use another number of elements"
        )
    return BreastMesh(mesh, quality)


def relax_on_surface(mesh: BlockMesh, surface: BreastSurface) -> BlockMesh:
    """Relax a first mesh, looking up the tangent planes of the surface anew in each round."""
    cell = _mean_cell(mesh)
    iterations = _ITERATIONS_A_ROUND * max(1, round(mesh.n / 10))
    lasting = SquaredTerms.stack([evenness(mesh, cell), anchor(mesh, cell)])
    for _ in range(_ROUNDS):
        mesh = relax(mesh, cell, SquaredTerms.stack([surface_fit(mesh, surface), lasting]), iterations)
    return mesh


def _mean_cell(mesh: BlockMesh) -> Floats:
    """Mean edge lengths (3,) in mm along i, j and k."""
    grid = mesh.points[mesh.node_grid()]
    return np.array([np.linalg.norm(np.diff(grid, axis=axis), axis=-1).mean() for axis in range(3)])
