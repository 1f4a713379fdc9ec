"""Grids of MR volumes from their headers, without decoding voxels: what preflight asks for."""

import math
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.dicom_headers import read_dicom
from stages.cohort.readers.mr.folder import choose_mr
from stages.cohort.readers.mr.nifti_header import nifti_affine
from stages.cohort.readers.mr.stacks import FEWEST_VOXELS

NIFTI = (".nii", ".nii.gz")
SPACING_MM = (0.1, 15.0)
LONGEST_MM = 1500.0
FARTHEST_MM = 3000.0
MOST_VOXELS = 1_000_000_000
_SAME_PLACE_MM = 0.1
_FLAT = 0.2


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

    def shift_to(self, other: "MrGrid") -> NDArray[np.float64] | None:
        """By how much (3,), mm, the other lies off, where both have the same voxels but for that; else None."""
        shift = other.corners.mean(axis=0) - self.corners.mean(axis=0)
        moved = MrGrid(self.shape, self.spacing, self.corners + shift)
        return shift if moved.same_as(other) else None

    def same_as(self, other: "MrGrid") -> bool:
        """Whether both have the same voxels, however their axes are ordered or turned round."""
        if sorted(self.shape) != sorted(other.shape):
            return False
        distances = np.linalg.norm(self.corners[:, None] - other.corners[None], axis=2)
        return bool(distances.min(axis=1).max() < _SAME_PLACE_MM)

    def index(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fractional voxel indices (..., 3) of points (..., 3), LPS mm."""
        last = np.array(self.shape) - 1
        along = (self.corners[[4, 2, 1]] - self.corners[0]) / last[:, None]
        return np.asarray((points - self.corners[0]) @ np.linalg.inv(along))

    def __str__(self) -> str:
        size = " x ".join(str(n) for n in self.shape)
        spacing = " x ".join(f"{s:.3g}" for s in self.spacing)
        return f"{size} voxels of {spacing} mm around ({', '.join(f'{c:.0f}' for c in self.corners.mean(axis=0))})"


def is_nifti(path: Path) -> bool:
    """Whether a file is taken for a NIfTI volume, by its name."""
    return path.name.lower().endswith(NIFTI)


def is_mr_dicom(path: Path) -> bool:
    """Whether a path is taken for DICOM: a folder, or a file that begins so.

    Raises:
        DataError: the file is DICOM and damaged.
    """
    return path.is_dir() or (not is_nifti(path) and read_dicom(path) is not None)


def read_mr_grid(path: Path, side: Laterality | None = None, series: str = "") -> MrGrid:
    """Grid of a NIfTI file, or of the fitting stack of DICOM slices in a folder.

    Args:
        path: the file or folder.
        side: of the breast; None where it does not matter.
        series: the column `mr_series`.

    Raises:
        DataError: the header is unreadable, of another modality, or no sensible volume.
    """
    if is_mr_dicom(path):
        stack = choose_mr(path, side, series).stack
        return _checked(path, stack.shape, stack.affine)
    if not is_nifti(path):
        raise DataError(f"{path}: is neither NIfTI nor DICOM; give .nii, .nii.gz or the folder of an MR series")
    return _checked(path, *nifti_affine(path))


def _checked(path: Path, shape: tuple[int, ...], affine: NDArray[np.float64]) -> MrGrid:
    size = " x ".join(str(n) for n in shape)
    if len(shape) > 3:
        raise DataError(f"{path}: holds several volumes ({size} voxels); write the one before contrast to its own file")
    if len(shape) < 3 or min(shape) < FEWEST_VOXELS:
        raise DataError(f"{path}: has {size} voxels, which is no volume; give one with at least {FEWEST_VOXELS} a side")
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    low, high = SPACING_MM
    listed = " x ".join(f"{s:.3g}" for s in spacing)
    if not np.all(np.isfinite(affine)) or spacing.min() < low or spacing.max() > high:
        raise DataError(
            f"{path}: the voxel spacing is {listed} mm, outside {low:g} to {high:g}; "
            "correct the header or export the volume again"
        )
    if max(n * s for n, s in zip(shape, spacing, strict=True)) > LONGEST_MM or math.prod(shape) > MOST_VOXELS:
        raise DataError(f"{path}: {size} voxels of {listed} mm are no breast volume; export the volume again")
    if abs(np.linalg.det(affine[:3, :3])) < _FLAT * np.prod(spacing):
        raise DataError(f"{path}: the header's axes do not span a volume; export the volume again")
    ends = np.array(list(product(*[(0, n - 1) for n in shape])), dtype=float)
    corners = ends @ affine[:3, :3].T + affine[:3, 3]
    if np.abs(corners).max() > FARTHEST_MM:
        what = f"the header puts the volume {np.abs(corners).max():.3g} mm from the scanner's centre"
        raise DataError(f"{path}: {what}; correct it or export the volume again")
    return MrGrid(shape, tuple(spacing), corners)
