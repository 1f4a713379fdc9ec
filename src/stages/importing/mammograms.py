"""Which of a patient's images are mammograms that can be registered, and which of several of one view is taken."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers.header_values import text
from stages.cohort.readers.mammogram.image import read_mammogram_facts
from stages.cohort.readers.mammogram.kind import lift_frame_values, other_kind
from stages.cohort.readers.mammogram.view_codes import IMPLANT, PARTIAL, side_and_view
from stages.cohort.readers.whole import check_whole_dicom

RULE = (
    "whole before partial, as presented before unprocessed, digital before synthetic, "
    "the larger field before the smaller, the later before the earlier"
)
"""Of several images of one view."""

BURNED_IN = "text is part of the picture and may name the patient"


@dataclass(frozen=True)
class FoundImage:
    """An image that may be a mammogram.

    Attributes:
        path, header: the file.
        study: its examination's identifier, never to be written.
        side, view: as its header says; None where it does not.
        refused: why it cannot be registered, empty where it can.
        flags: what is odd about it.
    """

    path: Path
    header: Dataset
    study: str
    side: Laterality | None
    view: str | None
    refused: str
    flags: tuple[str, ...]

    @property
    def what(self) -> str:
        """What it is, in words that identify nobody."""
        size = f"{dicom.text(self.header, 'Rows')} x {dicom.text(self.header, 'Columns')} pixels"
        intent = (text(self.header, "PresentationIntentType") or "").lower()
        return ", ".join(part for part in (f"{self.side or '?'} {self.view or '?'}", size, intent) if part)


def found_image(path: Path, header: Dataset) -> FoundImage:
    """Side, view and use of an image."""
    lift_frame_values(header)
    said = side_and_view(header)
    refused = other_kind(header) or ""
    if not refused and said.refused:
        refused = f"is {' and '.join(said.refused)}"
    if not refused and IMPLANT in said.flags:
        refused = "shows a breast implant, which the model does not know"
    if not refused and (said.side is None or said.view is None):
        refused = "its header does not say, or contradicts itself in, which side and view it is; add it by hand"
    if not refused:
        assert said.side is not None
        assert said.view is not None
        refused = _unusable(path, said.side, said.view)
    study = dicom.text(header, "StudyInstanceUID")
    flags = said.flags + ((BURNED_IN,) if text(header, "BurnedInAnnotation") == "YES" else ())
    return FoundImage(path, header, study, said.side, said.view, refused, flags)


def _unusable(path: Path, side: Laterality, view: str) -> str:
    """What `check` would find wrong with the image; empty where nothing."""
    try:
        facts = read_mammogram_facts(path, {}, side, view)  # type: ignore[arg-type]
        check_whole_dicom(path)
    except DataError as error:
        return f"cannot be used as it is: {str(error).removeprefix(f'{path}: ')}"
    if facts.pixel_mm is None:
        return "its header gives no pixel spacing; add it by hand with the column pixel_spacing_mm"
    return ""


def best_first(images: Sequence[FoundImage]) -> list[FoundImage]:
    """Images of one view in the order in which they are to be taken: see `RULE`."""
    return sorted(images, key=_rank)


def _rank(image: FoundImage) -> tuple[object, ...]:
    kind = "\\".join(part.upper() for part in dicom.texts(image.header, "ImageType"))
    described = f"{kind} {text(image.header, 'SeriesDescription') or ''}"
    synthetic = any(word in described for word in ("GENERATED_2D", "SYNTH", "C-VIEW", "TOMO_2D"))
    unprocessed = text(image.header, "PresentationIntentType") == "FOR PROCESSING"
    rows, columns = (dicom.number(image.header, keyword) or 0.0 for keyword in ("Rows", "Columns"))
    spacing = dicom.number(image.header, "ImagerPixelSpacing") or dicom.number(image.header, "PixelSpacing") or 0.0
    area_cm2 = round(rows * columns * spacing**2 / 100.0)
    moment = next((m for m in (dicom.text(image.header, k) for k in ("AcquisitionTime", "ContentTime")) if m), "")
    number = dicom.number(image.header, "InstanceNumber") or 0.0
    later = tuple(-ord(character) for character in moment)
    return (PARTIAL in image.flags, unprocessed, synthetic, -area_cm2, later, -number, str(image.path))
