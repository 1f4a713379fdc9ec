"""What a folder of DICOM files holds, by patient: MR pictures, mammograms and the rest."""

import hashlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers import header_values
from stages.cohort.readers.mr.frames import TAGS, MrFrame, frames_of

_IDENTITY = ("PatientName", "PatientBirthDate", "StudyDate", "ContentDate")
MAMMOGRAMS = ("MG", "CR", "DX", "DR", "RG")
"""Modalities of what may be a mammogram."""


@dataclass
class Patient:
    """Files of one person; nothing of this is written but in other words.

    Attributes:
        key: digest of the identifiers, by which patients are ordered.
        frames: MR pictures.
        images: files that may be mammograms, with their headers.
        unplaced: MR pictures whose place the header does not say.
        others: other files by modality.
        days: day of each examination, counted from some day, by its identifier; absent where none is given.
    """

    key: str
    frames: list[MrFrame] = field(default_factory=list)
    images: list[tuple[Path, Dataset]] = field(default_factory=list)
    unplaced: int = 0
    others: Counter[str] = field(default_factory=Counter)
    days: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Found:
    """A folder's contents.

    Attributes:
        patients: in the order of their keys, which no name and no number decides.
        unread: files that are damaged, or links without a file, with the reason.
    """

    patients: tuple[Patient, ...]
    unread: tuple[tuple[Path, str], ...]


def find(folder: Path, watched: Callable[[Sequence[Path]], Iterable[Path]]) -> Found:
    """Read all headers of a folder and its subfolders.

    Args:
        folder: the export.
        watched: passes the files on, and shows how far it is.
    """
    patients: dict[str, Patient] = {}
    unread: list[tuple[Path, str]] = []
    birthdays: dict[str, set[str]] = defaultdict(set)
    headers: list[tuple[Path, Dataset]] = []
    for path in watched(dicom.folder_files(folder)):
        try:
            header = dicom.read_dicom(path, tags=(*TAGS, *_IDENTITY)) if path.exists() else None
        except DataError as error:
            unread.append((path, str(error).removeprefix(f"{path}: ")))
            continue
        if not path.exists():
            unread.append((path, "is a link without a file behind it"))
        elif header is not None and not dicom.is_directory(header):
            headers.append((path, header))
            birthdays[_number(header)].add(dicom.text(header, "PatientBirthDate"))
    for path, header in headers:
        key = _key(header, birthdays[_number(header)] - {""})
        _add(patients.setdefault(key, Patient(key)), path, header)
    return Found(tuple(patients[key] for key in sorted(patients)), tuple(unread))


def _number(header: Dataset) -> str:
    return dicom.text(header, "PatientID").upper()


def _key(header: Dataset, birthdays: set[str]) -> str:
    """A digest of what says whose a file is: the number, with the birthday where one number has several of them."""
    number, birthday = _number(header), dicom.text(header, "PatientBirthDate")
    name = "".join(character for character in dicom.text(header, "PatientName").upper() if character.isalnum())
    told = [number, birthday if len(birthdays) > 1 else ""] if number else [name, birthday]
    told = told if any(told) else [dicom.text(header, "StudyInstanceUID")]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()


def _add(patient: Patient, path: Path, header: Dataset) -> None:
    modality = dicom.text(header, "Modality").upper() or "no modality"
    if (day := _day(header)) is not None:
        patient.days.setdefault(dicom.text(header, "StudyInstanceUID"), day)
    if modality == "MR" and "Rows" in header:
        frames = list(frames_of(path, header))
        patient.frames += [frame for frame in frames if frame is not None]
        patient.unplaced += frames.count(None)
    elif modality in MAMMOGRAMS and "Rows" in header:
        whole = dicom.read_dicom(path)
        assert whole is not None
        patient.images.append((path, whole))
    else:
        patient.others[modality] += 1


def _day(header: Dataset) -> int | None:
    for keyword in ("StudyDate", "AcquisitionDate", "ContentDate"):
        written = header_values.texts(header, keyword)
        try:
            if written:
                return date.fromisoformat(written[0]).toordinal()
        except ValueError:
            continue
    return None
