"""Voxels of a stack of MR slices, each rescaled as its own header says."""

import copy
import tempfile
import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers import header_values
from stages.cohort.readers.mr.frames import MrFrame
from stages.cohort.readers.mr.stacks import MrStack

_RESCALING = (
    "RescaleSlope",
    "RescaleIntercept",
    "RescaleType",
    "ModalityLUTSequence",
    "PixelValueTransformationSequence",
)


def stack_voxels(stack: MrStack) -> NDArray[np.float32]:
    """Intensities, shape as the stack's.

    Raises:
        DataError: pixels are missing, or in a compression that cannot be decoded.
    """
    voxels = np.empty(stack.shape, dtype=np.float32)
    by_file: dict[Path, list[tuple[int, MrFrame]]] = defaultdict(list)
    for place, frame in enumerate(stack.frames):
        by_file[frame.file].append((place, frame))
    for path, frames in by_file.items():
        stored = stored_frames(path)
        for place, frame in frames:
            if frame.index >= len(stored) or stored[frame.index].shape != stack.shape[1::-1]:
                raise DataError(f"{path}: its pixels are not as many as its header says; export the series again")
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite then is refused
                voxels[:, :, place] = stored[frame.index].T * np.float32(frame.slope) + np.float32(frame.intercept)
    return voxels


def stored_frames(path: Path) -> NDArray[Any]:
    """Stored values (frames, rows, columns) of a file, as they are before any rescaling.

    Raises:
        DataError: as `stack_voxels`.
    """
    header = dicom.read_dicom(path, pixels=True)
    if header is None:
        raise DataError(f"{path}: is no DICOM file any more; export the series again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = np.asarray(header.pixel_array)
    except (NotImplementedError, RuntimeError):
        found = _decoded_by_itk(path, header)
    except Exception as error:
        raise DataError(f"{path}: pixels are missing or cannot be decoded; export the series again") from error
    return found[None] if found.ndim == 2 else found


def _decoded_by_itk(path: Path, header: Dataset) -> NDArray[Any]:
    """Pixels in a compression that needs GDCM, which SimpleITK brings.

    It reads a copy without rescaling, as it would rescale all slices by the first one's numbers.
    """
    import SimpleITK

    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "slice.dcm"
        _without_rescaling(header).save_as(plain)
        try:
            return np.asarray(SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(plain))))
        except RuntimeError as error:
            name = header.file_meta.TransferSyntaxUID.name
            raise DataError(f"{path}: {name} cannot be decoded here; export the series uncompressed") from error


def _without_rescaling(header: Dataset) -> Dataset:
    plain = copy.deepcopy(header)
    groups = [
        item
        for name in ("SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence")
        for item in header_values.items(plain, name)
    ]
    for part in (plain, *groups):
        for keyword in _RESCALING:
            if keyword in part:
                del part[keyword]
    return plain
