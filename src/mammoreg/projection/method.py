"""What one method makes of a view: the deformed breast, its projection and its outline."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32, Points
from mammoreg.geometry import Volume
from mammoreg.localization.deformation import AffineDeformation, MeshDeformation, MethodView
from mammoreg.materials.attenuation import attenuation_map
from mammoreg.projection.cone_beam import project_shadow, project_volume
from mammoreg.projection.deformed import MeshInverse, PlateGrid, grid_around, resample, undeformed_positions


@dataclass(frozen=True)
class ImagedTissue:
    """The undeformed breast in the breast frame, on one grid.

    Attributes:
        attenuation: 1/mm at 20 keV; zero outside the breast.
        mask: 1 in the breast, 0 elsewhere.
    """

    attenuation: Volume
    mask: Volume


@dataclass(frozen=True)
class DeformedBreast:
    """The breast between the plates on a grid of the plate frame, by one method.

    Attributes:
        grid: of the plate frame.
        origins: where each voxel came from, breast frame, (nx, ny, nz, 3), mm; nan where there is no breast.
    """

    grid: PlateGrid
    origins: NDArray[np.float32]

    def carry(self, source: Volume) -> Volume:
        """A volume of the breast frame, deformed; zero where there is no breast."""
        return self.grid.volume(resample(source, self.origins))


def tissue_of_labels(labels: Volume, breast_mask: Volume) -> ImagedTissue:
    """Attenuation and mask of the breast from its label map (0 to 4) and mask, volumes on one grid."""
    inside = np.asarray(breast_mask.data) != 0
    attenuation = np.where(inside, attenuation_map(np.asarray(labels.data)), np.float32(0.0))
    return ImagedTissue(labels.with_data(attenuation), breast_mask.with_data(inside.astype(np.float32)))


def deformed_nodes(method: MethodView, nodes: Points) -> Points:
    """Mesh nodes (N, 3), breast frame, as the method places them in the plate frame, mm."""
    deformation = method.deformation
    return deformation.deformed if isinstance(deformation, MeshDeformation) else deformation.forward(nodes)


def deform_breast(method: MethodView, nodes: Points, spacing_mm: float) -> DeformedBreast:
    """The breast as a method deforms it, on a regular grid of the plate frame.

    Args:
        method: affine, or of a finite element solution.
        nodes: of the undeformed mesh (N, 3), breast frame, mm.
        spacing_mm: of the grid.
    """
    placed = deformed_nodes(method, nodes)
    grid = grid_around(placed, spacing_mm)
    deformation = method.deformation
    if isinstance(deformation, AffineDeformation):
        return DeformedBreast(grid, undeformed_positions(deformation.inverse, grid))
    if not isinstance(deformation, MeshDeformation):
        raise TypeError(f"no inverse known for a deformation of type {type(deformation).__name__}")
    inverse = MeshInverse(deformation.reference.points, placed, deformation.reference.hexes)
    return DeformedBreast(grid, undeformed_positions(inverse, grid))


def project_breast(
    breast: DeformedBreast, tissue: ImagedTissue, method: MethodView, step: int
) -> tuple[Floats32, NDArray[np.bool_]]:
    """Projected attenuation and silhouette of a deformed breast, at the middles of blocks of `step` pixels."""
    image = project_volume(breast.carry(tissue.attenuation), method.geometry, step)
    return image, project_shadow(breast.carry(tissue.mask), method.geometry, step)
