"""What DICOM of MR volumes lies in a folder: all of its stacks, and the one to take."""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pydicom.uid import EnhancedMRImageStorage, MRImageStorage

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers.mr.choice import MrChoice, choose
from stages.cohort.readers.mr.frames import TAGS, MrFrame, frames_of
from stages.cohort.readers.mr.stacks import MrStack, stacks_of

_NIFTI = (".nii", ".nii.gz")
_PICTURES = (MRImageStorage, EnhancedMRImageStorage)
_MOST_NAMED = 5


@dataclass(frozen=True)
class MrFolder:
    """What a folder holds.

    Attributes:
        stacks: MR volumes and what is left over of them.
        others: files of other kinds by modality.
        unplaced: MR pictures whose header does not say where they lie.
    """

    stacks: tuple[MrStack, ...]
    others: Counter[str]
    unplaced: int


def choose_mr(path: Path, side: Laterality | None = None, wanted: str = "") -> MrChoice:
    """The stack to take of a folder, or of one DICOM file of several frames.

    Args:
        path: folder, searched with its subfolders, or file.
        side: of the breast; None where it does not matter.
        wanted: the column `mr_series`.

    Raises:
        DataError: there is none, or it cannot be told which; all that is there is listed.
    """
    found = read_mr_folder(path)
    if not found.stacks:
        raise DataError(f"{path}: {_nothing(path, found)}")
    try:
        return choose(found.stacks, side, wanted)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def read_mr_folder(path: Path) -> MrFolder:
    """All MR stacks of a folder and its subfolders, or of one file.

    Raises:
        DataError: files are missing behind links, or damaged.
    """
    files = dicom.folder_files(path) if path.is_dir() else [path]
    if gone := [file for file in files if not file.exists()]:
        listed = ", ".join(str(file.relative_to(path)) for file in gone[:_MOST_NAMED])
        more = f" and {len(gone) - _MOST_NAMED} more" if len(gone) > _MOST_NAMED else ""
        raise DataError(f"{path}: {listed}{more}: a link without a file behind it; copy the files, or remove the link")
    marks = ((file, file.stat()) for file in files)
    return _read(tuple((file, mark.st_size, mark.st_mtime_ns) for file, mark in marks))


@lru_cache(maxsize=8)
def _read(files: tuple[tuple[Path, int, int], ...]) -> MrFolder:
    """Read headers; both breasts of a patient, and each column that asks, share them."""
    frames: list[MrFrame] = []
    others: Counter[str] = Counter()
    unplaced = 0
    for path, _, _ in files:
        header = dicom.read_dicom(path, tags=TAGS)
        if header is None or dicom.is_directory(header):
            continue
        modality = dicom.text(header, "Modality").upper() or "none"
        if "Rows" not in header and dicom.text(header, "SOPClassUID") in _PICTURES:
            raise DataError(f"{path}: ends early or is damaged; copy or export it again")
        if modality != "MR" or "Rows" not in header:
            others[modality if modality != "MR" else "MR without a picture"] += 1
            continue
        for frame in frames_of(path, header):
            if frame is None:
                unplaced += 1
            else:
                frames.append(frame)
    return MrFolder(tuple(stacks_of(frames)), others, unplaced)


def _nothing(path: Path, found: MrFolder) -> str:
    """Why a folder has no MR stack, and what to do."""
    if found.unplaced:
        return "the DICOM headers lack the slices' place; export the series again"
    if found.others:
        return (
            f"modality is {', '.join(sorted(found.others))}, not MR; name the folder of an MR series, or of the patient"
        )
    if path.is_dir() and any(file.name.lower().endswith(_NIFTI) for file in dicom.folder_files(path)):
        return "is a folder of NIfTI files; name one of them"
    return "holds no DICOM image; name the folder of an MR series, or of the patient"
