"""Headers of NIfTI files: what nibabel makes of them, unless they contradict themselves."""

import logging
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError

# What it remarks of odd headers is for programmers; what matters is said below.
logging.getLogger("nibabel.global").setLevel(logging.CRITICAL)

LPS_OF_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_SAME_SPACING = 0.02
_SAME_PLACE_MM = 1.0


def load_nifti(path: Path) -> Any:
    """The file as nibabel opens it.

    Raises:
        DataError: it cannot be opened.
    """
    import nibabel

    try:
        return nibabel.load(path)
    except Exception as error:  # nibabel has exceptions of its own for each part of a header
        raise DataError(f"{path}: cannot be read as NIfTI; export the volume again") from error


def nifti_affine(path: Path) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    """Shape, and affine from voxel indices to LPS, mm.

    Raises:
        DataError: the header is damaged, gives no place, or two of them.
    """
    image = load_nifti(path)
    try:
        shape, affine, kind = image.shape, image.affine, image.get_data_dtype()
        zooms = _stored_spacing(path, type(image.header))
        places = [
            found for found in (image.get_sform(coded=True)[0], image.get_qform(coded=True)[0]) if found is not None
        ]
    except Exception as error:  # as above
        raise DataError(f"{path}: cannot be read as NIfTI; export the volume again") from error
    if kind.kind not in "biuf":
        raise DataError(f"{path}: holds {kind} voxels, not grey values; export the magnitude volume")
    if not np.all(zooms > 0):
        listed = " x ".join(f"{z:g}" for z in zooms)
        raise DataError(f"{path}: the header's voxel spacing is {listed} mm; correct it or export the volume again")
    if not places:
        raise DataError(f"{path}: the header gives no orientation (sform and qform are unset); export again")
    _check_spacing(path, zooms, np.linalg.norm(affine[:3, :3], axis=0))
    shape = shape[:3] if all(n == 1 for n in shape[3:]) else shape
    _check_places(path, shape[:3], places)
    return shape, LPS_OF_RAS @ affine


def _stored_spacing(path: Path, header: Any) -> NDArray[np.float64]:
    """Voxel spacing as the file has it: on loading nibabel takes 1 for 0."""
    from nibabel.openers import ImageOpener

    with ImageOpener(path) as file:
        return np.asarray(header.from_fileobj(file, check=False)["pixdim"][1:4], dtype=float)


def _check_spacing(path: Path, zooms: NDArray[np.float64], spacing: NDArray[np.float64]) -> None:
    """Refuse a header that gives two sizes of a voxel."""
    if np.isfinite(spacing).all() and np.abs(zooms - spacing).max() > _SAME_SPACING * spacing.min():
        two = " and ".join(" x ".join(f"{s:.4g}" for s in sizes) for sizes in (zooms, spacing))
        raise DataError(
            f"{path}: pixdim and the affine give two voxel spacings, {two} mm; correct the header or export again"
        )


def _check_places(path: Path, shape: tuple[int, ...], places: list[NDArray[np.float64]]) -> None:
    """Refuse a header that puts the volume in two places: programs differ in which they take."""
    ends = np.array([(*end, 1.0) for end in product(*[(0, n - 1) for n in shape])])
    if len(places) == 2 and ends.shape[1] == len(places[0]):
        apart_mm = float(np.linalg.norm(ends @ (places[0] - places[1]).T, axis=1).max())
        if not apart_mm <= _SAME_PLACE_MM:
            raise DataError(
                f"{path}: sform and qform put the volume in two places, up to {apart_mm:.3g} mm apart, and programs "
                "differ in which they take; correct the header or export again"
            )
