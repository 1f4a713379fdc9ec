"""MR volumes as axis-aligned LPS volumes: NIfTI files, and the fitting stack of a folder of DICOM files."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, volume_of_affine
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.mr.choice import MrChoice
from stages.cohort.readers.mr.folder import choose_mr
from stages.cohort.readers.mr.header import is_mr_dicom, read_mr_grid
from stages.cohort.readers.mr.nifti_header import LPS_OF_RAS, load_nifti
from stages.cohort.readers.mr.voxels import stack_voxels

LABEL_ROUNDING = 1e-3
"""A header's scale factor may take labels off whole numbers by this much."""

MOST_LOST_SLICES = 4


def read_mr(path: Path, side: Laterality | None = None, series: str = "") -> Volume:
    """Read the intensities of an MR volume, LPS mm, float32; oblique ones are resampled, 0 outside.

    Args:
        path: NIfTI file, or folder of DICOM files.
        side: of the breast; None where it does not matter.
        series: the column `mr_series`.

    Raises:
        DataError: unreadable, another modality, no fitting series, no sensible grid, or values that are not finite.
    """
    read_mr_grid(path, side, series)
    data, affine = _dicom_voxels(path, side, series) if is_mr_dicom(path) else _nifti_voxels(path)
    if not np.isfinite(data).all():
        raise DataError(f"{path}: holds values that are not finite (NaN or infinite); export the volume again")
    _check_no_blank_slice(path, data)
    return volume_of_affine(data.astype(np.float32, copy=False), affine, order=1)


def _check_no_blank_slice(path: Path, data: NDArray[Any]) -> None:
    """Refuse a volume with slices lost in the making: of one value, between slices that are not.

    Many in a row may be the empty space between two breasts that were cut out.
    """
    for axis in range(3):
        others = tuple(n for n in range(3) if n != axis)
        blank = data.max(axis=others) == data.min(axis=others)
        shown = np.flatnonzero(~blank)
        lost = [int(n) for n in np.flatnonzero(blank) if len(shown) and shown[0] < n < shown[-1]]
        if 0 < len(lost) <= MOST_LOST_SLICES:
            listed = ", ".join(str(n + 1) for n in lost)
            raise DataError(f"{path}: slice {listed} along axis {axis + 1} is blank; export the volume again")


def mr_choice(path: Path, side: Laterality | None = None, series: str = "") -> MrChoice | None:
    """The account of the series that `read_mr` takes of a folder; None of a NIfTI file, which holds one volume.

    Raises:
        DataError: as `read_mr`.
    """
    return choose_mr(path, side, series) if is_mr_dicom(path) else None


def read_nifti(path: Path) -> Volume:
    """Read a label map or mask, LPS mm, in the file's own type; oblique ones are resampled to the nearest voxel.

    It lands on the same voxels as `read_mr` of a volume with the same grid.

    Raises:
        DataError: unreadable, or no sensible grid.
    """
    read_mr_grid(path)
    data, affine = _nifti_voxels(path)
    return volume_of_affine(data, affine, order=0)


def read_labels(path: Path) -> Volume:
    """Read a map of whole labels, LPS mm; what differs from them by rounding alone is rounded.

    Raises:
        DataError: as `read_nifti`.
    """
    volume = read_nifti(path)
    if volume.data.dtype.kind != "f":
        return volume
    whole = np.rint(volume.data)
    return volume.with_data(np.where(np.abs(volume.data - whole) < LABEL_ROUNDING, whole, volume.data))


def _nifti_voxels(path: Path) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Voxels and the affine to LPS of a NIfTI file whose header was checked."""
    image = load_nifti(path)
    try:
        data = np.asanyarray(image.dataobj)
    except Exception as error:  # what decompresses and what scales have exceptions of their own
        raise DataError(f"{path}: the voxels cannot be read; the file may be truncated, copy it again") from error
    return data.reshape(data.shape[:3]), LPS_OF_RAS @ image.affine


def _dicom_voxels(path: Path, side: Laterality | None, series: str) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Voxels, rescaled as the headers say, and the affine to LPS of the fitting stack."""
    stack = choose_mr(path, side, series).stack
    return stack_voxels(stack), stack.affine
