"""DICOM files of a folder, and values of their headers of which only sound ones count."""

import logging
import warnings
from collections.abc import Sequence
from pathlib import Path

from pydicom import dcmread
from pydicom.dataset import Dataset
from pydicom.uid import MediaStorageDirectoryStorage

from mammoreg.errors import DataError
from stages.cohort.readers import header_values

# What it remarks of odd files is for programmers; what matters is said by the readers.
logging.getLogger("pydicom").setLevel(logging.ERROR)

_PREAMBLE = 128
_HEADS = (b"\x08\x00", b"\x02\x00")
"""Group numbers with which a DICOM file without preamble begins, little endian."""


def folder_files(folder: Path) -> list[Path]:
    """All files of a folder and its subfolders in a stable order; hidden ones, which systems leave, are passed over.

    A link without a file behind it counts: it stands for a file that is missing.
    """
    members = (p for p in folder.rglob("*") if not any(part.startswith(".") for part in p.relative_to(folder).parts))
    return sorted(p for p in members if p.is_file() or (p.is_symlink() and not p.exists()))


def read_dicom(path: Path, *, pixels: bool = False, tags: Sequence[str] | None = None) -> Dataset | None:
    """The header of a DICOM file, or all of it; None for a file of another kind.

    Args:
        path: the file.
        pixels: read the pixels too.
        tags: keywords to which the header is limited, which saves time; None for all.

    Raises:
        DataError: the file cannot be opened, or is DICOM and damaged.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_PREAMBLE + 4)
        bare = head[_PREAMBLE:] != b"DICM"
        if bare and (head[:2] not in _HEADS or len(head) < _PREAMBLE):
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = dcmread(
                path,
                stop_before_pixels=not pixels,
                force=bare,
                specific_tags=None if tags is None else [*map(header_values.tag_of, tags)],
            )
    except OSError as error:
        raise DataError(f"{path}: cannot be opened ({error.strerror or error}); copy it again or remove it") from error
    except Exception as error:  # whatever pydicom makes of bytes that are no DICOM
        raise DataError(f"{path}: begins as DICOM and cannot be read; copy or export it again") from error
    if not (is_directory(found) or "SOPClassUID" in found or "Modality" in found):
        if bare:
            return None
        raise DataError(f"{path}: begins as DICOM and cannot be read; copy or export it again")
    return found


def is_directory(header: Dataset) -> bool:
    """Whether a file is a DICOMDIR, the list of what lies on a disc."""
    meta = getattr(header, "file_meta", None)
    return meta is not None and text(meta, "MediaStorageSOPClassUID") == MediaStorageDirectoryStorage


def text(header: Dataset, keyword: str) -> str:
    """The first value of an element as text without blanks around it; empty where there is none."""
    return next(iter(header_values.texts(header, keyword)), "")


def texts(header: Dataset, keyword: str) -> tuple[str, ...]:
    """The upper-case values of an element."""
    return tuple(part.upper() for part in header_values.texts(header, keyword) if part)


def number(header: Dataset, keyword: str) -> float | None:
    """A finite number, the first of several; None where there is none."""
    found = numbers(header, keyword)
    return found[0] if found else None


def numbers(header: Dataset, keyword: str, count: int | None = None) -> tuple[float, ...] | None:
    """Finite numbers; None where they are not all numbers, or not as many as asked for."""
    parsed = [header_values.number(part) for part in header_values.texts(header, keyword)]
    found = tuple(part.value for part in parsed if part is not None)
    if not found or len(found) < len(parsed) or (count is not None and len(found) != count):
        return None
    return found
