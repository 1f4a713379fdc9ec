"""Whether the files of one breast are of one woman, as far as their headers tell; nothing that they say is kept."""

from collections.abc import Collection, Iterator
from pathlib import Path

from mammoreg.errors import DataError
from stages.cohort.cases import Cohort
from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers.mammogram.image import is_picture
from stages.cohort.readers.mr.volume import mr_choice

_TAGS = ("SOPClassUID", "Modality", "PatientID", "PatientBirthDate")
_PATIENTS = "the headers of mr and image name different patients"


def strangers(cohort: Cohort, made: Collection[Path] = ()) -> Iterator[tuple[str, str, bool]]:
    """Mammograms of another woman than the MR volume: where, what to say, and whether the birthdays say so too.

    Numbers alone may differ where each file was given its own on the way; numbers and birthdays do not.

    Args:
        cohort: what both tables say.
        made: files that the workflow makes itself; they are not looked at.
    """
    for (case, view), row in cohort.mammograms.items():
        if row.image in made:
            continue
        mr, image = _person_of_mr(cohort, case), _person(row.image) if not is_picture(row.image) else None
        if mr is None or image is None or not (mr[0] and image[0]) or mr[0] == image[0]:
            continue
        where = f"{cohort.views_file.name if cohort.views_file else ''} ({case} {view}), column image"
        yield where, f"{row.image}: {_PATIENTS}", bool(mr[1] and image[1] and mr[1] != image[1])


def _person_of_mr(cohort: Cohort, case: str) -> tuple[str, str] | None:
    row = cohort.cases[case]
    try:
        choice = mr_choice(row.mr, row.laterality, row.mr_series or "") if row.mr.exists() else None
    except DataError:
        return None  # a fault of its own
    return None if choice is None else _person(choice.stack.first.file)


def _person(path: Path) -> tuple[str, str] | None:
    """Number and birthday; None where the file cannot be read, which is a fault of its own."""
    try:
        header = dicom.read_dicom(path, tags=_TAGS) if path.exists() else None
    except DataError:
        return None
    if header is None:
        return None
    return dicom.text(header, "PatientID").upper(), dicom.text(header, "PatientBirthDate")
