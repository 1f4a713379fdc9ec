"""Dense tissue of the MR volume, tied to the mesh, for the comparison with a mammogram."""

from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.locate import Locator
from mammoreg.pose.estimate import Tissue
from stages.artefact import Artefact

GLAND = 2
BLOCK = 2  # voxels a side that become one tissue point


def coarse_tissue(segment: Artefact, mesh: BlockMesh) -> Tissue:
    """Share of gland in blocks of breast voxels."""
    labels, breast = (
        segment.volume(name).between_lps_and_breast(segment.laterality) for name in ("labels", "breast_mask")
    )
    gland, inside = (_blocks(v) for v in (labels.with_data(labels.data == GLAND), breast.with_data(breast.data > 0)))
    kept = inside.data > 0.5
    element, local, _ = Locator(mesh.points, mesh.hexes()).locate(inside.centres(kept))
    return Tissue(mesh.hexes(), element, local, gland.data[kept])


def _blocks(volume: Volume) -> Volume:
    """Means over blocks of voxels; a remainder at the far end is left out."""
    nx, ny, nz = (n // BLOCK for n in volume.shape)
    crop = volume.data[: nx * BLOCK, : ny * BLOCK, : nz * BLOCK].astype(float)
    means = crop.reshape(nx, BLOCK, ny, BLOCK, nz, BLOCK).mean(axis=(1, 3, 5))
    return Volume(means, volume.origin + 0.5 * (BLOCK - 1) * volume.spacing, volume.spacing * BLOCK)
