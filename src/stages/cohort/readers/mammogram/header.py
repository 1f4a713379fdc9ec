"""Imaging facts of a mammogram, from its DICOM header and the columns of views.tsv that override it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mammogram_orientation import flips_of_orientation
from mammoreg.imaging.views import PROJECTIONS, View
from stages.cohort.readers.header_values import text, texts
from stages.cohort.readers.mammogram.numbers import Numbers
from stages.cohort.readers.mammogram.view_codes import Said, is_direction_pair, side_and_view

DEFAULT_SOURCE_DETECTOR_MM = 650.0
DEFAULT_SUPPORT_DETECTOR_MM = 15.0
EXAGGERATED = "exaggerated view: the patient's turn about her long axis is not modelled"


@dataclass(frozen=True)
class MammogramFacts:
    r"""How a mammogram was taken and stored.

    Attributes:
        orientation: row and column direction as stored, such as ``P\L``, or None where neither header nor table says.
        photometric: PhotometricInterpretation, or None.
        linear: grey values are proportional to exposure (unprocessed detector data).
        intent: PresentationIntentType, or None.
        pixel_mm: pixel spacing at the detector; None where unknown.
        thickness_mm: plate gap; None where unknown.
        force_n: plate force; None where unknown.
        angle_deg: projection angle a of `mammoreg.geometry`.
        source_detector_mm: distance of source and detector.
        support_detector_mm: height of the support surface above the detector.
        estimated: names of these that are defaults or missing.
        flags: what was noticed in reading, in words.
    """

    orientation: str | None
    photometric: str | None
    linear: bool
    intent: str | None
    pixel_mm: float | None
    thickness_mm: float | None
    force_n: float | None
    angle_deg: float
    source_detector_mm: float
    support_detector_mm: float
    estimated: tuple[str, ...]
    flags: tuple[str, ...]


def mammogram_facts(
    path: Path, header: Dataset, row: Mapping[str, str], laterality: Laterality, view: View
) -> MammogramFacts:
    """Facts of one image; a column of the table takes precedence over the header.

    Args:
        path: the image, for messages.
        header: its DICOM header; empty for a PNG or TIFF.
        row: the row of views.tsv; empty cells may be left out.

    Raises:
        DataError: If header and table contradict each other in side, view or orientation, or a value is impossible.
    """
    numbers = Numbers(path, header, row)
    flags = _checked_side_and_view(numbers, laterality, view)
    known = {
        "pixel_spacing_mm": numbers.pixel_mm(),
        "thickness_mm": numbers.thickness_mm(),
        "force_n": numbers.force_n(),
        "angle_deg": numbers.angle_deg(view),
        "source_detector_mm": numbers.source_detector_mm(),
        "support_detector_mm": numbers.support_detector_mm(),
    }
    orientation = row.get("orientation", "").strip() or _orientation(header)
    if orientation:
        _check_orientation(path, orientation, laterality, view)
    photometric, intent = text(header, "PhotometricInterpretation"), text(header, "PresentationIntentType")
    named = {**known, "orientation": orientation, "polarity": photometric}
    estimated = tuple(name for name, value in named.items() if value is None)
    return MammogramFacts(
        orientation=orientation,
        photometric=photometric,
        linear=text(header, "PixelIntensityRelationship") == "LIN" and intent == "FOR PROCESSING",
        intent=intent,
        pixel_mm=known["pixel_spacing_mm"],
        thickness_mm=known["thickness_mm"],
        force_n=known["force_n"],
        angle_deg=_or(known["angle_deg"], PROJECTIONS[view].angle_deg),
        source_detector_mm=_or(known["source_detector_mm"], DEFAULT_SOURCE_DETECTOR_MM),
        support_detector_mm=_or(known["support_detector_mm"], DEFAULT_SUPPORT_DETECTOR_MM),
        estimated=estimated,
        flags=(*flags, *numbers.flags),
    )


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _checked_side_and_view(numbers: Numbers, laterality: Laterality, view: View) -> tuple[str, ...]:
    """What the header says of side and view that a reader must know.

    Raises:
        DataError: the table says otherwise, or the view cannot be registered.
    """
    found = side_and_view(numbers.header)
    other_side = "correct cases.tsv or name the image of the other side"
    wrong = [
        *_contradictions(found.sides, laterality, "laterality", other_side),
        *_contradictions(found.views, view, "view", "correct views.tsv or name the image of that view"),
    ]
    if wrong:
        raise DataError("; ".join(f"{numbers.path}: {what}" for what in wrong))
    if found.refused:
        remedy = "name a plain view of the breast, or exclude the row"
        raise numbers.fault(f"is {' and '.join(found.refused)}, which cannot be registered", remedy)
    exaggerated = (EXAGGERATED,) if view in ("XCCL", "XCCM") else ()
    return (*exaggerated, *found.flags)


def _contradictions(said: Iterable[Said], wanted: str, column: str, remedy: str) -> list[str]:
    return [
        f"the header's {one.element} is {one.value}, the table's {column} is {wanted}; {remedy}"
        for one in said
        if wanted not in one.names
    ]


def _check_orientation(path: Path, orientation: str, laterality: Laterality, view: View) -> None:
    try:
        flips_of_orientation(orientation, laterality, view)
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def _orientation(header: Dataset) -> str | None:
    value = texts(header, "PatientOrientation")
    return "\\".join(value) if is_direction_pair(value) else None
