"""Lesion masks: on the MR grid, as segmentations of 3D Slicer or DICOM, and on mammograms."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from stages.cohort.readers.marks.dicom_seg import read_dicom_seg
from stages.cohort.readers.marks.nrrd_seg import is_nrrd, read_nrrd
from stages.cohort.readers.marks.points import MASK_NAME
from stages.cohort.readers.mr.header import is_nifti

LARGEST_ML = 500.0
"""A ball of 98 mm; a larger mask is the breast's or the background's."""
LARGEST_SHARE = 0.25
"""Of a picture or a volume; a mask that covers more is inverted."""
MOST_LABELS = 16
"""Whole numbers up to this one, and several of them, are labels rather than grey values."""

_SEVERAL = "list several lesions in a .tsv instead, one row each"


def read_masks(path: Path) -> dict[str, Volume]:
    """Lesion masks in LPS mm by name, each what lies above half of its maximum.

    A NIfTI mask and a single segment are called `lesion`. Of several segments the one of that name is taken alone, else
    each is a lesion.

    Raises:
        DataError: the file is unreadable, or a mask is empty, has several components or is larger than any lesion.
    """
    if is_nifti(path):
        return {MASK_NAME: _mask_on_mr_grid(path)}
    segments = _chosen(read_nrrd(path) if is_nrrd(path) else read_dicom_seg(path))
    return {name: _lesion(f"{path}{_of(name, segments)}", volume) for name, volume in segments.items()}


def mask_names(path: Path) -> list[str]:
    """Names of the lesions of a mask; NIfTI, which has one, is not opened for that."""
    if is_nifti(path):
        return [MASK_NAME]
    return list(_chosen(read_nrrd(path) if is_nrrd(path) else read_dicom_seg(path)))


def _of(name: str, segments: dict[str, Volume]) -> str:
    return f", segment {name!r}" if len(segments) > 1 else ""


def _chosen(segments: dict[str, Volume]) -> dict[str, Volume]:
    lesion = [name for name in segments if name.strip().lower() == MASK_NAME]
    chosen = lesion if len(lesion) == 1 else list(segments)
    return {MASK_NAME: segments[chosen[0]]} if len(chosen) == 1 else segments


def _mask_on_mr_grid(path: Path) -> Volume:
    from stages.cohort.readers.mr.volume import read_nifti

    volume = read_nifti(path)
    found = _lesion(str(path), volume)
    if (share := float(np.mean(found.data))) > LARGEST_SHARE:
        raise DataError(f"{path}: the lesion mask covers {share:.0%} of the volume; {_INVERTED}")
    return found


_INVERTED = "it is inverted, or not a lesion's: mark the lesion alone, by values above half of the maximum"


def _lesion(where: str, volume: Volume) -> Volume:
    mask = _above_half(where, np.asarray(volume.data))
    _check_one_component(where, mask)
    size_ml = float(np.count_nonzero(mask)) * volume.voxel_mm3 / 1000.0
    if size_ml > LARGEST_ML:
        raise DataError(f"{where}: the lesion mask holds {size_ml:.0f} ml, more than any lesion; {_INVERTED}")
    return volume.with_data(mask)


def read_image_mask(path: Path) -> NDArray[np.bool_]:
    """A lesion mask (rows, columns) on a mammogram as stored: what lies above half of its maximum.

    Raises:
        DataError: the picture is unreadable, or the mask empty, of several components or larger than any lesion.
    """
    mask = _above_half(str(path), _grey(path))
    _check_one_component(str(path), mask)
    if (share := float(mask.mean())) > LARGEST_SHARE:
        raise DataError(f"{path}: the lesion mask covers {share:.0%} of the picture; {_INVERTED}")
    return mask


def _grey(path: Path) -> NDArray[Any]:
    """Brightness (rows, columns) of a picture; what is transparent is black."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            pixels = np.asarray(picture.convert("RGBA") if picture.mode in ("P", "PA") else picture)
    except (OSError, ValueError, SyntaxError) as error:
        raise DataError(f"{path}: cannot be read as a picture; write the mask again as .png") from error
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] in (2, 4):
        opaque = pixels[..., -1].astype(float) / np.iinfo(pixels.dtype).max
        return np.asarray(pixels[..., :-1].max(axis=-1) * opaque)
    return np.asarray(pixels.max(axis=-1))


def _above_half(where: str, values: NDArray[Any]) -> NDArray[np.bool_]:
    """What lies above half of the maximum.

    Raises:
        DataError: nothing is marked, or several labels.
    """
    known = np.nan_to_num(values.astype(float), nan=0.0, posinf=0.0, neginf=0.0)
    most = float(known.max(initial=0.0))
    if not most > 0.0:
        raise DataError(f"{where}: the lesion mask is empty; mark the lesion or leave the cell empty")
    if most <= MOST_LABELS:
        labels = np.unique(known[known != 0.0])
        if 1 < len(labels) <= MOST_LABELS and np.all(labels == np.rint(labels)):
            listed = ", ".join(f"{label:g}" for label in labels)
            raise DataError(f"{where}: holds the labels {listed}; keep the lesion's alone")
    return np.asarray(known > 0.5 * most)


def _check_one_component(where: str, mask: NDArray[np.bool_]) -> None:
    from scipy import ndimage

    _, count = ndimage.label(mask, structure=np.ones((3,) * mask.ndim))
    if count > 1:
        raise DataError(f"{where}: the lesion mask has {count} components; {_SEVERAL}")
