"""MR volumes as axis-aligned LPS volumes: NIfTI files and folders that hold one DICOM series."""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, volume_of_affine
from stages.cohort.readers.mr_header import read_mr_grid

SLICE_TOLERANCE = 0.05
"""Slice distances may differ by this share."""


def read_mr(path: Path) -> Volume:
    """Read the intensities of an MR volume, LPS mm, float32; oblique ones are resampled, 0 outside.

    Raises:
        DataError: unreadable, another modality, several series, no sensible grid, or values that are not finite.
    """
    read_mr_grid(path)
    data, affine = _dicom_voxels(path) if path.is_dir() else _nifti_voxels(path)
    if not np.isfinite(data).all():
        raise DataError(f"{path}: holds values that are not finite (NaN or infinite); export the volume again")
    return volume_of_affine(data.astype(np.float32), affine, order=1)


def read_nifti(path: Path) -> Volume:
    """Read a label map or mask, LPS mm, in the file's own type; oblique ones are resampled to the nearest voxel.

    It lands on the same voxels as `read_mr` of a volume with the same grid.

    Raises:
        DataError: unreadable, or no sensible grid.
    """
    read_mr_grid(path)
    data, affine = _nifti_voxels(path)
    return volume_of_affine(data, affine, order=0)


def _nifti_voxels(path: Path) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Voxels and the affine to LPS of a NIfTI file."""
    import nibabel

    try:
        image: Any = nibabel.load(path)
        if int(image.header["sform_code"]) == 0 and int(image.header["qform_code"]) == 0:
            raise DataError(f"{path}: the header gives no orientation (sform and qform are unset); export again")
        data = np.asanyarray(image.dataobj)
        affine = np.diag([-1.0, -1.0, 1.0, 1.0]) @ image.affine
    except (OSError, EOFError, zlib.error, ValueError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{path}: the voxels cannot be read; the file may be truncated, copy it again") from error
    if data.dtype.kind not in "biuf":
        raise DataError(f"{path}: holds {data.dtype} voxels, not grey values; export the magnitude volume")
    return data.reshape(data.shape[:3]), affine


def _dicom_voxels(folder: Path) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Voxels, rescaled as the headers say, and the affine to LPS of the one DICOM series of a folder."""
    import SimpleITK

    series = SimpleITK.ImageSeriesReader.GetGDCMSeriesIDs(str(folder))
    if len(series) != 1:
        raise DataError(f"{folder}: holds {len(series)} stacks of DICOM slices; keep the files of one volume in it")
    names = SimpleITK.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder), series[0])
    _check_slices(folder, names)
    try:
        image = SimpleITK.ReadImage(names)
    except RuntimeError as error:
        raise DataError(f"{folder}: pixels are missing or cannot be decoded; export the series again") from error
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    return SimpleITK.GetArrayFromImage(image).transpose(2, 1, 0), affine


def _check_slices(folder: Path, names: tuple[str, ...]) -> None:
    """Refuse a stack with a slice missing, a place taken twice, or slices of unlike size."""
    from pydicom import dcmread

    headers = [dcmread(name, stop_before_pixels=True) for name in names]
    if len({(h.Rows, h.Columns) for h in headers}) > 1:
        raise DataError(f"{folder}: the slices differ in size; keep the files of one volume in it")
    places = np.array([h.ImagePositionPatient for h in headers], dtype=float)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    middle = float(np.median(steps))
    if middle <= 0.0 or np.abs(steps - middle).max() > SLICE_TOLERANCE * middle:
        raise DataError(
            f"{folder}: slices lie {steps.min():.2f} to {steps.max():.2f} mm apart; one is missing or several volumes "
            "are mixed; export one complete series"
        )
