"""Whether files hold all the voxels and pixels that their headers promise: reads them to the end, decodes nothing."""

import gzip
import math
import zlib
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.dicom_headers import read_dicom
from stages.cohort.readers.mr.folder import choose_mr
from stages.cohort.readers.mr.header import is_mr_dicom, is_nifti
from stages.cohort.readers.mr.nifti_header import load_nifti
from stages.cohort.readers.mr.voxels import stored_frames

_CHUNK = 1 << 22


def check_whole_mr(path: Path, side: Laterality | None = None, series: str = "") -> None:
    """Check that a NIfTI file, or each DICOM file of the stack that is taken, is as long as its header says.

    Raises:
        DataError: voxels are missing, or what compresses them is damaged or cannot be decoded.
    """
    if is_mr_dicom(path):
        files = dict.fromkeys(frame.file for frame in choose_mr(path, side, series).stack.frames)
        for member in files:
            check_whole_dicom(member)
        stored_frames(next(iter(files)))  # one shows whether the compression can be read
    elif is_nifti(path):
        _check_whole_nifti(path)


def _check_whole_nifti(path: Path) -> None:
    image = load_nifti(path)
    promised = int(image.dataobj.offset) + math.prod(image.shape) * image.header.get_data_dtype().itemsize
    try:
        found = _unpacked_size(path) if path.name.lower().endswith(".gz") else path.stat().st_size
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path}: ends early or is damaged ({error}); copy or export it again") from error
    if found < promised:
        raise DataError(f"{path}: holds {found} of the {promised} bytes that its header promises; copy it again")


def _unpacked_size(path: Path) -> int:
    """Bytes in a gzip file; it is read to its end, where its checksum is."""
    size = 0
    with gzip.open(path) as file:
        while chunk := file.read(_CHUNK):
            size += len(chunk)
    return size


def check_whole_dicom(path: Path) -> None:
    """Check that a DICOM image holds its pixels; a file that is no DICOM image is passed over.

    Raises:
        DataError: pixels are missing.
    """
    damaged = f"{path}: ends early or is damaged; copy or export it again"
    try:
        data = read_dicom(path, pixels=True)
    except DataError as error:
        raise DataError(damaged) from error
    if data is None or "Rows" not in data or "BitsAllocated" not in data:
        return
    try:
        pixels, promised = data.get("PixelData"), _promised_bytes(data)
    except Exception as error:  # sizes that are no numbers, a transfer syntax that is none
        raise DataError(damaged) from error
    if not pixels:
        raise DataError(f"{path}: holds no pixels; copy or export it again")
    if promised is not None and len(pixels) < promised:
        raise DataError(f"{path}: holds {len(pixels)} of the {promised} bytes of its pixels; copy or export it again")


def _promised_bytes(header: Dataset) -> int | None:
    """Bytes of the pixels by the header; None where they are compressed, and known only once they are decoded."""
    if header.file_meta.TransferSyntaxUID.is_compressed:
        return None
    samples = int(header.get("SamplesPerPixel") or 1) * int(header.get("NumberOfFrames") or 1)
    return int(header.Rows) * int(header.Columns) * samples * int(header.BitsAllocated) // 8


def check_whole_picture(path: Path) -> None:
    """Check that a PNG or TIFF picture can be decoded to its end.

    Raises:
        DataError: it cannot.
    """
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
    except (OSError, SyntaxError, ValueError) as error:
        raise DataError(f"{path}: ends early or is damaged; export the picture again") from error
