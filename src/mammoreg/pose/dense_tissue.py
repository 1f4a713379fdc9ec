"""Dense tissue of the MR volume, tied to the mesh, for the comparison with a mammogram."""

import numpy as np

from mammoreg.geometry import Volume
from mammoreg.labels import Label
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.locate import Locator
from mammoreg.pose.estimate import DenseTissue

BLOCK_MM = 2.8  # a tissue point stands for a block of about this side; wider gaps show between the plates


def dense_tissue(labels: Volume, breast: Volume, mesh: BlockMesh) -> DenseTissue:
    """Fraction of gland in blocks of the breast's voxels.

    Args:
        labels: tissues, breast frame.
        breast: mask of the breast on the same grid.
        mesh: undeformed, breast frame.
    """
    gland = _blocks(labels.with_data(labels.data == Label.GLAND))
    inside = _blocks(breast.with_data(breast.data > 0))
    kept = inside.data > 0.5
    element, local, _ = Locator(mesh.points, mesh.hexes()).locate(inside.centres(kept))
    return DenseTissue(mesh.hexes(), element, local, gland.data[kept])


def _blocks(volume: Volume) -> Volume:
    """Means over blocks of voxels; a remainder at the far end is left out."""
    bx, by, bz = (max(1, round(BLOCK_MM / float(side))) for side in volume.spacing)
    nx, ny, nz = (n // b for n, b in zip(volume.shape, (bx, by, bz), strict=True))
    crop = volume.data[: nx * bx, : ny * by, : nz * bz].astype(float)
    means = crop.reshape(nx, bx, ny, by, nz, bz).mean(axis=(1, 3, 5))
    block = np.array([bx, by, bz])
    return Volume(means, volume.origin + 0.5 * (block - 1) * volume.spacing, volume.spacing * block, volume.frame)
