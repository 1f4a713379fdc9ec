"""Imaging facts of a mammogram, from its DICOM header and the columns of views.tsv that override it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mammogram_orientation import View, flips_of_orientation

DEFAULT_SOURCE_DETECTOR_MM = 650.0
DEFAULT_SUPPORT_DETECTOR_MM = 15.0
DEFAULT_ANGLE_DEG: Mapping[str, float] = {"CC": 0.0, "MLO": 45.0}
LARGEST_FORCE_N = 300.0
LARGEST_ANGLE_DEG: Mapping[str, float] = {"CC": 30.0, "MLO": 90.0}


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
        angle_deg: CC: signed roll; MLO: positive angle.
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


class _Source:
    """Header and table of one image, with the names that error messages need."""

    def __init__(self, path: Path, header: Dataset, row: Mapping[str, str]) -> None:
        self.path, self.header, self.row = path, header, row
        self.flags: list[str] = []

    def fault(self, what: str, remedy: str) -> DataError:
        return DataError(f"{self.path}: {what}; {remedy}")

    def text(self, keyword: str) -> str | None:
        value = self.header.get(keyword)
        return str(value).strip().upper() or None if value is not None else None

    def number(self, keyword: str) -> float | None:
        """A number of the header; zero, which vendors write for unknown, counts as missing."""
        value = self.header.get(keyword)
        try:
            return float(value) or None if value not in (None, "") else None
        except (TypeError, ValueError) as error:
            raise self.fault(f"{keyword} {value!r} is not a number", "correct the header or the table") from error

    def override(self, column: str) -> float | None:
        text = self.row.get(column, "").strip()
        try:
            return float(text) if text else None
        except ValueError as error:
            raise DataError(f"views.tsv: {column} {text!r} of {self.path.name} is not a number; correct it") from error

    def first_positive(self, name: str, *values: float | None) -> float | None:
        """The first value that is given.

        Raises:
            DataError: If it is not positive and finite.
        """
        value = next((v for v in values if v is not None), None)
        if value is not None and not 0.0 < value < float("inf"):
            raise self.fault(f"{name} {value:g} is not positive", f"correct it or give the column {name}")
        return value


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
    source = _Source(path, header, row)
    _check_side_and_view(source, laterality, view)
    known = {
        "pixel_spacing_mm": source.first_positive(
            "pixel_spacing_mm", source.override("pixel_spacing_mm"), _pixel_spacing(source)
        ),
        "thickness_mm": source.first_positive(
            "thickness_mm", source.override("thickness_mm"), source.number("BodyPartThickness")
        ),
        "force_n": source.first_positive("force_n", source.override("force_n"), _force(source)),
        "angle_deg": _angle(source, view),
        "source_detector_mm": source.first_positive(
            "source_detector_mm", source.override("source_detector_mm"), source.number("DistanceSourceToDetector")
        ),
        "support_detector_mm": _support_height(source),
    }
    orientation = row.get("orientation", "").strip() or _orientation(source)
    if orientation:
        _check_orientation(source, orientation, laterality, view)
    texts = {"orientation": orientation, "polarity": source.text("PhotometricInterpretation")}
    estimated = tuple(name for name, value in {**known, **texts}.items() if value is None)
    intent = source.text("PresentationIntentType")
    return MammogramFacts(
        orientation=orientation,
        photometric=texts["polarity"],
        linear=source.text("PixelIntensityRelationship") == "LIN" and intent == "FOR PROCESSING",
        intent=intent,
        pixel_mm=known["pixel_spacing_mm"],
        thickness_mm=known["thickness_mm"],
        force_n=known["force_n"],
        angle_deg=_or(known["angle_deg"], DEFAULT_ANGLE_DEG[view]),
        source_detector_mm=_or(known["source_detector_mm"], DEFAULT_SOURCE_DETECTOR_MM),
        support_detector_mm=_or(known["support_detector_mm"], DEFAULT_SUPPORT_DETECTOR_MM),
        estimated=estimated,
        flags=tuple(source.flags),
    )


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _check_side_and_view(source: _Source, laterality: Laterality, view: View) -> None:
    side = source.text("ImageLaterality") or source.text("Laterality")
    if side is not None and side != laterality:
        raise source.fault(
            f"the header's ImageLaterality is {side}, the table's laterality is {laterality}",
            "correct cases.tsv or name the image of the other side",
        )
    position = source.text("ViewPosition")
    if position is not None and position != view:
        raise source.fault(
            f"the header's ViewPosition is {position}, the table's view is {view}",
            "correct views.tsv or name the image of the other view",
        )


def _check_orientation(source: _Source, orientation: str, laterality: Laterality, view: View) -> None:
    try:
        flips_of_orientation(orientation, laterality, view)
    except DataError as error:
        raise DataError(f"{source.path}: {error}") from error


def _orientation(source: _Source) -> str | None:
    value = source.header.get("PatientOrientation")
    parts = [str(part) for part in value] if value else []
    return "\\".join(parts) if len(parts) == 2 and all(parts) else None


def _pixel_spacing(source: _Source) -> float | None:
    """Spacing at the detector; PixelSpacing holds in the patient, so the magnification takes it to the detector."""
    spacing, zoom = source.header.get("ImagerPixelSpacing"), 1.0
    if not spacing:
        spacing = source.header.get("PixelSpacing")
        zoom = source.number("EstimatedRadiographicMagnificationFactor") or 1.0
    if not spacing:
        return None
    rows, columns = (float(value) for value in spacing)
    if abs(rows - columns) > 0.01 * max(abs(rows), abs(columns)):
        raise source.fault(f"pixels of {rows:g} x {columns:g} mm are not square", "resample the image")
    return rows * zoom


def _force(source: _Source) -> float | None:
    force = source.number("CompressionForce")
    if force is not None and force > LARGEST_FORCE_N:
        # No unit presses with more than 300 N: one vendor writes tenths of a newton.
        source.flags.append(f"CompressionForce {force:g} read as dN")
        return force / 10.0
    return force


def _angle(source: _Source, view: View) -> float | None:
    angle = source.override("angle_deg")
    if angle is None:
        value = source.header.get("PositionerPrimaryAngle")
        angle = None if value in (None, "") else float(value)
    if angle is None:
        return None
    if view == "MLO" and angle < 0.0:
        source.flags.append(f"negative angle {angle:g} degrees in MLO: its absolute value is used")
        angle = -angle
    if abs(angle) > LARGEST_ANGLE_DEG[view]:
        raise source.fault(
            f"angle {angle:g} degrees is impossible in {view}", "correct the header or the column angle_deg"
        )
    return angle


def _support_height(source: _Source) -> float | None:
    detector, patient = source.number("DistanceSourceToDetector"), source.number("DistanceSourceToPatient")
    if detector is None or patient is None or patient >= detector:
        return None
    return detector - patient
