"""MR volumes as axis-aligned LPS volumes: NIfTI files and folders that hold one DICOM series."""

import zlib
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from stages.cohort.readers.mr_header import read_mr_grid

ALIGNED_SINE = 0.002
"""Axes off the patient's by less than this (0.1 degree, 0.3 mm over a breast) count as aligned."""
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
    return lps_volume(data.astype(np.float32), affine, order=1)


def read_nifti(path: Path) -> Volume:
    """Read a label map or mask, LPS mm, in the file's own type; oblique ones are resampled to the nearest voxel.

    It lands on the same voxels as `read_mr` of a volume with the same grid.

    Raises:
        DataError: unreadable, or no sensible grid.
    """
    read_mr_grid(path)
    data, affine = _nifti_voxels(path)
    return lps_volume(data, affine, order=0)


def lps_volume(data: NDArray[Any], affine: NDArray[np.float64], order: Literal[0, 1]) -> Volume:
    """Reorder voxels so that the axes run along +x, +y, +z of LPS; resample where no reordering does.

    Args:
        data: voxels (ni, nj, nk).
        affine: (4, 4) from voxel indices to LPS, mm.
        order: interpolation of oblique volumes, 0 nearest, 1 linear.
    """
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    cosines = affine[:3, :3] / spacing
    axes = _nearest_axes(cosines)
    signs = np.sign(cosines[axes, np.arange(3)])
    if np.abs(cosines - np.eye(3)[:, axes] * signs).max() > ALIGNED_SINE:
        return _resampled(data, affine, spacing[np.argsort(axes)], order)
    flipped = data[tuple(slice(None, None, int(sign)) for sign in signs)]
    start = affine[:3, 3] + affine[:3, :3] @ np.where(signs < 0, np.array(data.shape) - 1, 0)
    back = np.argsort(axes)
    return Volume(np.ascontiguousarray(flipped.transpose(back)), start, spacing[back], "LPS")


def _nearest_axes(cosines: NDArray[np.float64]) -> NDArray[np.intp]:
    """The patient axis nearest to each voxel axis; each is taken once, the best match first."""
    left, axes = np.abs(cosines), np.zeros(3, dtype=np.intp)
    for _ in range(3):
        patient, voxel = np.unravel_index(int(np.argmax(left)), left.shape)
        axes[voxel] = patient
        left[patient, :] = left[:, voxel] = -1.0
    return axes


def _resampled(
    data: NDArray[Any], affine: NDArray[np.float64], spacing: NDArray[np.float64], order: Literal[0, 1]
) -> Volume:
    """An oblique volume on the smallest axis-aligned grid that holds it; 0 outside it."""
    ends = np.array(np.meshgrid(*[(0, n - 1) for n in data.shape])).reshape(3, -1)
    corners = affine[:3, :3] @ ends + affine[:3, 3:]
    origin = corners.min(axis=1)
    shape = tuple(int(n) + 1 for n in np.ceil((corners.max(axis=1) - origin) / spacing))
    inverse = np.linalg.inv(affine[:3, :3])
    offset = inverse @ (origin - affine[:3, 3])
    found = ndimage.affine_transform(data, inverse * spacing, offset=offset.tolist(), output_shape=shape, order=order)
    return Volume(np.asarray(found), origin, spacing, "LPS")


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
