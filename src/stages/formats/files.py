"""Formats that other programs open, as bytes that depend on the contents alone; and grids of MR volumes."""

import gzip
import io
import itertools
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from stages.cohort.readers.mr_header import read_mr_grid

_LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_COMPRESSION_LEVEL = 1


def nifti_bytes(data: NDArray[Any], affine_lps: NDArray[np.float64], intent: int = 0) -> bytes:
    """A compressed NIfTI file without a clock in it.

    Args:
        data: samples, (nx, ny, nz) or (nx, ny, nz, 1, 3).
        affine_lps: voxel index to LPS mm, (4, 4).
        intent: NIfTI intent code.
    """
    import nibabel as nib

    image = nib.Nifti1Image(data, _LPS_TO_RAS @ affine_lps)
    image.header.set_xyzt_units("mm")
    image.header.set_intent(intent)
    packed = io.BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb", compresslevel=_COMPRESSION_LEVEL, mtime=0, filename="") as file:
        file.write(image.to_bytes())
    return packed.getvalue()


def volume_affine(volume: Volume) -> NDArray[np.float64]:
    """Voxel index to mm in the volume's own frame, (4, 4)."""
    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    return affine


def vtu_bytes(
    points: Points, hexes: NDArray[Any], point_data: Mapping[str, Any], cell_data: Mapping[str, Any]
) -> bytes:
    """A hexahedral mesh as VTU, which ParaView and 3D Slicer open."""
    import meshio

    mesh = meshio.Mesh(points, [("hexahedron", hexes)], point_data=dict(point_data), cell_data=dict(cell_data))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        mesh.write(path)
        return path.read_bytes()


def mask_png(mask: NDArray[Any]) -> bytes:
    """A mask as a grey PNG: 255 inside, 0 outside."""
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(packed, format="PNG")
    return packed.getvalue()


def mr_grid(path: Path) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    """Shape of the MR volume as the user gave it, and its affine (4, 4) from voxel index to LPS mm."""
    grid = read_mr_grid(path)
    steps = [(grid.corners[far] - grid.corners[0]) / (n - 1) for far, n in zip((4, 2, 1), grid.shape, strict=True)]
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = np.array(steps).T, grid.corners[0]
    return grid.shape, affine


def on_grid(mask: Volume, shape: tuple[int, ...], affine: NDArray[np.float64]) -> NDArray[np.uint8]:
    """A mask at the voxels of another grid, by nearest neighbour.

    Args:
        mask: any grid, LPS.
        shape: of the other grid.
        affine: (4, 4) from its voxel indices to LPS mm.
    """
    found = np.zeros(shape, dtype=np.uint8)
    ends = mask.to_world(np.array(list(itertools.product(*((-1, n) for n in mask.shape)))))
    corners = (ends - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, shape)
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, shape)
    index = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1)
    places = index @ affine[:3, :3].T + affine[:3, 3]
    found[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = mask.sample(places, order=0) > 0.5
    return found
