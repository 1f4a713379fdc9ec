"""Grids of MR volumes from their headers, without decoding voxels: what preflight asks for."""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError

NIFTI = (".nii", ".nii.gz")
SPACING_MM = (0.1, 15.0)
FEWEST_VOXELS = 8
_SAME_PLACE_MM = 0.1


@dataclass(frozen=True)
class MrGrid:
    """Size and place of a volume.

    Attributes:
        shape: number of voxels along each axis.
        spacing: distance of voxel centres along each axis, mm.
        corners: centres (8, 3) of the corner voxels, LPS mm.
    """

    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    corners: NDArray[np.float64]

    def same_as(self, other: "MrGrid") -> bool:
        """Whether both have the same voxels, however their axes are ordered or turned round."""
        if sorted(self.shape) != sorted(other.shape):
            return False
        distances = np.linalg.norm(self.corners[:, None] - other.corners[None], axis=2)
        return bool(distances.min(axis=1).max() < _SAME_PLACE_MM)

    def __str__(self) -> str:
        size = " x ".join(str(n) for n in self.shape)
        spacing = " x ".join(f"{s:.3g}" for s in self.spacing)
        return f"{size} voxels of {spacing} mm around ({', '.join(f'{c:.0f}' for c in self.corners.mean(axis=0))})"


def is_nifti(path: Path) -> bool:
    """Whether a file is taken for a NIfTI volume, by its name."""
    return path.name.lower().endswith(NIFTI)


def read_mr_grid(path: Path) -> MrGrid:
    """Grid of a NIfTI file, or of a folder that holds one DICOM series.

    Raises:
        DataError: the header is unreadable, of another modality, or no sensible volume.
    """
    if path.is_dir():
        return _checked(path, *_dicom_affine(path))
    if not is_nifti(path):
        raise DataError(f"{path}: is neither NIfTI nor a folder; give .nii, .nii.gz or the folder of one DICOM series")
    return _checked(path, *_nifti_affine(path))


def _nifti_affine(path: Path) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    import nibabel
    from nibabel.filebasedimages import ImageFileError

    try:
        image: Any = nibabel.load(path)
        shape, affine = image.shape, image.affine
        zooms = _stored_spacing(path, type(image.header))
    except (OSError, EOFError, ValueError, ImageFileError) as error:
        raise DataError(f"{path}: cannot be read as NIfTI; export the volume again") from error
    if not np.all(zooms > 0):
        listed = " x ".join(f"{z:g}" for z in zooms)
        raise DataError(f"{path}: the header's voxel spacing is {listed} mm; correct it or export the volume again")
    shape = shape[:3] if all(n == 1 for n in shape[3:]) else shape
    return shape, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine


def _stored_spacing(path: Path, header: Any) -> NDArray[np.float64]:
    """Voxel spacing as the file has it: on loading nibabel takes 1 for 0."""
    from nibabel.openers import ImageOpener

    with ImageOpener(path) as file:
        return np.asarray(header.from_fileobj(file, check=False)["pixdim"][1:4], dtype=float)


def _dicom_affine(folder: Path) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    slices = _slices(folder)
    if len({s.get("SeriesInstanceUID") for s in slices}) > 1:
        raise DataError(f"{folder}: holds several DICOM series; keep the files of one in it")
    try:
        first = slices[0]
        along_row, along_column = np.array(first.ImageOrientationPatient, dtype=float).reshape(2, 3)
        normal = np.cross(along_row, along_column)
        slices.sort(key=lambda s: float(np.dot(normal, np.array(s.ImagePositionPatient, dtype=float))))
        start, end = (np.array(slices[i].ImagePositionPatient, dtype=float) for i in (0, -1))
        between_rows, between_columns = (float(v) for v in first.PixelSpacing)
        shape = (int(first.Columns), int(first.Rows), len(slices))
    except (AttributeError, TypeError, ValueError) as error:
        raise DataError(f"{folder}: the DICOM headers lack the slices' place; export the series again") from error
    affine = np.eye(4)
    step = (end - start) / max(len(slices) - 1, 1)
    affine[:3] = np.column_stack([along_row * between_columns, along_column * between_rows, step, start])
    return shape, affine


def _slices(folder: Path) -> list[Any]:
    from pydicom import dcmread
    from pydicom.errors import InvalidDicomError

    found = []
    for member in sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")):
        try:
            header = dcmread(member, stop_before_pixels=True)
        except (OSError, InvalidDicomError, EOFError, ValueError):
            continue
        if "ImagePositionPatient" in header or header.get("Modality") != "MR":
            found.append(header)
    if not found:
        raise DataError(f"{folder}: holds no DICOM image; name the folder of one MR series")
    if other := sorted({str(s.get("Modality", "none")) for s in found} - {"MR"}):
        raise DataError(f"{folder}: modality is {', '.join(other)}, not MR; name the folder of one MR series")
    return found


def _checked(path: Path, shape: tuple[int, ...], affine: NDArray[np.float64]) -> MrGrid:
    if len(shape) != 3 or min(shape) < FEWEST_VOXELS:
        size = " x ".join(str(n) for n in shape)
        raise DataError(f"{path}: has {size} voxels, which is no volume; give one with at least {FEWEST_VOXELS} a side")
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    low, high = SPACING_MM
    if not np.all(np.isfinite(affine)) or spacing.min() < low or spacing.max() > high:
        listed = " x ".join(f"{s:.3g}" for s in spacing)
        raise DataError(
            f"{path}: the voxel spacing is {listed} mm, outside {low:g} to {high:g}; "
            "correct the header or export the volume again"
        )
    ends = np.array(list(product(*[(0, n - 1) for n in shape])), dtype=float)
    return MrGrid(shape, tuple(spacing), ends @ affine[:3, :3].T + affine[:3, 3])
