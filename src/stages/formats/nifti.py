"""NIfTI volumes (`.nii.gz`), whose world is RAS, as bytes that depend on the contents alone."""

import gzip
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume

DISPLACEMENT_INTENT = 1006
"""NIfTI intent of vectors that move points; readers turn them like positions."""
_LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_COMPRESSION_LEVEL = 4


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
    return gzip.compress(image.to_bytes(), compresslevel=_COMPRESSION_LEVEL, mtime=0)


def displacement_nifti(vectors_lps: NDArray[np.float32], affine_lps: NDArray[np.float64]) -> bytes:
    """Displacement vectors (nx, ny, nz, 3), LPS mm: NIfTI keeps them in its fifth axis, in its own RAS directions."""
    ras = vectors_lps * np.array([-1.0, -1.0, 1.0], dtype=np.float32)
    return nifti_bytes(ras[:, :, :, None], affine_lps, DISPLACEMENT_INTENT)


def volume_affine(volume: Volume) -> NDArray[np.float64]:
    """Voxel index to mm in the volume's own frame, (4, 4)."""
    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    return affine
