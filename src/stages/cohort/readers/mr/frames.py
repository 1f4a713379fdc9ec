"""MR pictures of DICOM files, one by one: where each lies and how it was taken, classic or multi-frame."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset

from stages.cohort.readers import dicom_headers as dicom
from stages.cohort.readers import header_values

_GROUPS = {
    "ImagePositionPatient": "PlanePositionSequence",
    "ImageOrientationPatient": "PlaneOrientationSequence",
    "PixelSpacing": "PixelMeasuresSequence",
    "SliceThickness": "PixelMeasuresSequence",
    "SpacingBetweenSlices": "PixelMeasuresSequence",
    "EffectiveEchoTime": "MREchoSequence",
    "RepetitionTime": "MRTimingAndRelatedParametersSequence",
    "FlipAngle": "MRTimingAndRelatedParametersSequence",
    "FrameType": "MRImageFrameTypeSequence",
    "AcquisitionContrast": "MRImageFrameTypeSequence",
    "ComplexImageComponent": "MRImageFrameTypeSequence",
    "DiffusionBValue": "MRDiffusionSequence",
    "StackID": "FrameContentSequence",
    "TemporalPositionIndex": "FrameContentSequence",
    "FrameAcquisitionNumber": "FrameContentSequence",
    "FrameReferenceDateTime": "FrameContentSequence",
    "FrameAcquisitionDateTime": "FrameContentSequence",
    "NominalCardiacTriggerDelayTime": "CardiacSynchronizationSequence",
    "RescaleSlope": "PixelValueTransformationSequence",
    "RescaleIntercept": "PixelValueTransformationSequence",
    "FrameLaterality": "FrameAnatomySequence",
}
"""Where a multi-frame file keeps what a classic one has at its root (DICOM PS3.3 C.7.6.16, C.8.13.5)."""

TAGS = (
    *("SOPClassUID", "SOPInstanceUID", "Modality", "PatientID", "StudyInstanceUID", "SeriesInstanceUID"),
    *("SeriesNumber", "InstanceNumber", "FrameOfReferenceUID", "ImageType", "SeriesDescription", "ProtocolName"),
    *("SequenceName", "PulseSequenceName", "ScanningSequence", "ScanOptions", "MRAcquisitionType", "EchoTime"),
    *("InversionTime", "ContrastBolusAgent", "ContrastBolusAgentSequence", "TemporalPositionIdentifier"),
    *("AcquisitionNumber", "TriggerTime", "AcquisitionDateTime", "AcquisitionDate", "AcquisitionTime", "ContentTime"),
    *("SeriesTime", "Rows", "Columns", "SamplesPerPixel", "BitsAllocated", "NumberOfFrames", "Laterality"),
    *("EchoPulseSequence", "InversionRecovery", "SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"),
    *_GROUPS,
)


@dataclass(frozen=True)
class MrFrame:
    """A picture: a classic file, or a frame of a multi-frame one. What a header does not say is None or empty.

    Attributes:
        file, index: where its pixels are, the index counting from 0.
        patient, study, series, instance, frame_of_reference: identifiers, to be compared and never to be written.
        series_number, instance_number: as the scanner counts.
        rows, columns: size in pixels.
        grey: one sample a pixel.
        position: centre (3,) of the first pixel, LPS mm.
        axes: direction of a row and of a column (2, 3), LPS.
        pixel_mm: distance of rows, of columns, mm.
        thickness_mm, between_mm: SliceThickness and SpacingBetweenSlices.
        slope, intercept: from stored values to intensities.
        kind: ImageType (FrameType) in upper case, with AcquisitionContrast and ComplexImageComponent.
        words: of the descriptions of series, protocol and sequence, lower case; only to be looked up in.
        scanning: ScanningSequence in upper case.
        three_d: MRAcquisitionType is 3D.
        echo_ms, repetition_ms, inversion_ms, b_value, stack: of the acquisition.
        agent: a contrast agent is named.
        order: what may tell phases apart, by its name.
        laterality: L or R where the header names one breast.
    """

    file: Path
    index: int
    patient: str
    study: str
    series: str
    instance: str
    frame_of_reference: str
    series_number: int | None
    instance_number: int | None
    rows: int
    columns: int
    grey: bool
    position: NDArray[np.float64]
    axes: NDArray[np.float64]
    pixel_mm: tuple[float, float]
    thickness_mm: float | None
    between_mm: float | None
    slope: float
    intercept: float
    kind: tuple[str, ...]
    words: frozenset[str]
    scanning: tuple[str, ...]
    three_d: bool
    echo_ms: float | None
    repetition_ms: float | None
    inversion_ms: float | None
    b_value: float | None
    stack: str
    agent: bool
    order: Mapping[str, str | float]
    laterality: str

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Direction (3,) across the picture, LPS."""
        return np.cross(self.axes[0], self.axes[1])

    @cached_property
    def along(self) -> float:
        """Place along the normal, mm."""
        return float(self.normal @ self.position)


class _Values:
    """Values of one frame: its own functional groups first, then the shared ones, then the file's root."""

    def __init__(self, header: Dataset, shared: Dataset | None = None, own: Dataset | None = None) -> None:
        self.header = header
        self._groups = [group for group in (own, shared) if group is not None]

    def _holder(self, keyword: str) -> Dataset:
        for group in self._groups:
            for item in header_values.items(group, _GROUPS[keyword]) if keyword in _GROUPS else ():
                if header_values.texts(item, keyword):
                    return item
        return self.header

    def numbers(self, keyword: str, count: int | None = None) -> tuple[float, ...] | None:
        return dicom.numbers(self._holder(keyword), keyword, count)

    def number(self, *keywords: str) -> float | None:
        """The first of these that is a number."""
        found = (dicom.number(self._holder(keyword), keyword) for keyword in keywords)
        return next((value for value in found if value is not None), None)

    def whole(self, keyword: str) -> int | None:
        value = self.number(keyword)
        return None if value is None else int(value)

    def text(self, keyword: str) -> str:
        return dicom.text(self._holder(keyword), keyword)

    def texts(self, *keywords: str) -> tuple[str, ...]:
        return tuple(part for keyword in keywords for part in dicom.texts(self._holder(keyword), keyword))


def frames_of(path: Path, header: Dataset) -> Iterator[MrFrame | None]:
    """The pictures of an MR file; None for each whose place or size the header does not say."""
    own = header_values.items(header, "PerFrameFunctionalGroupsSequence")
    shared = header_values.items(header, "SharedFunctionalGroupsSequence")
    if not own:
        yield _frame(path, 0, _Values(header, *shared[:1]))
    for index, group in enumerate(own):
        yield _frame(path, index, _Values(header, shared[0] if shared else None, group))


def _frame(path: Path, index: int, values: _Values) -> MrFrame | None:
    position, axes = values.numbers("ImagePositionPatient", 3), values.numbers("ImageOrientationPatient", 6)
    spacing, size = values.numbers("PixelSpacing", 2), (values.whole("Rows"), values.whole("Columns"))
    if position is None or axes is None or spacing is None or None in size or min(spacing) <= 0.0:
        return None
    directions = np.array(axes).reshape(2, 3)
    lengths = np.linalg.norm(directions, axis=1)
    if np.abs(lengths - 1.0).max() > 0.01 or abs(float(directions[0] @ directions[1])) > 0.01:
        return None
    slope, intercept = values.number("RescaleSlope"), values.number("RescaleIntercept")
    return MrFrame(
        file=path,
        index=index,
        patient=values.text("PatientID"),
        study=values.text("StudyInstanceUID"),
        series=values.text("SeriesInstanceUID"),
        instance=values.text("SOPInstanceUID"),
        frame_of_reference=values.text("FrameOfReferenceUID"),
        series_number=values.whole("SeriesNumber"),
        instance_number=values.whole("InstanceNumber"),
        rows=size[0] or 0,
        columns=size[1] or 0,
        grey=(values.whole("SamplesPerPixel") or 1) == 1,
        position=np.array(position),
        axes=directions / lengths[:, None],
        pixel_mm=(spacing[0], spacing[1]),
        thickness_mm=values.number("SliceThickness"),
        between_mm=values.number("SpacingBetweenSlices"),
        slope=1.0 if slope is None or slope == 0.0 else slope,
        intercept=intercept or 0.0,
        kind=values.texts("ImageType", "FrameType", "AcquisitionContrast", "ComplexImageComponent"),
        words=_words(values),
        scanning=values.texts("ScanningSequence", "EchoPulseSequence"),
        three_d="3D" in values.texts("MRAcquisitionType"),
        echo_ms=values.number("EffectiveEchoTime", "EchoTime"),
        repetition_ms=values.number("RepetitionTime"),
        inversion_ms=values.number("InversionTime"),
        b_value=values.number("DiffusionBValue"),
        stack=values.text("StackID"),
        agent=bool(
            values.texts("ContrastBolusAgent") or header_values.items(values.header, "ContrastBolusAgentSequence")
        ),
        order=_order(values),
        laterality=next(iter(values.texts("FrameLaterality", "Laterality")), "")[:1],
    )


def _words(values: _Values) -> frozenset[str]:
    named = ("SeriesDescription", "ProtocolName", "SequenceName", "PulseSequenceName")
    found = re.findall(r"[a-zà-ÿ0-9+]+", " ".join(values.text(keyword) for keyword in named).lower())
    # Series are counted, as in sub1 and sub2.
    return frozenset([*found, *(word.rstrip("0123456789") for word in found)]) - {""}


def _order(values: _Values) -> dict[str, str | float]:
    """What may tell the phases of a dynamic series apart, the surest first; what is not given is left out."""
    keys = {
        "temporal position": values.number("TemporalPositionIndex", "TemporalPositionIdentifier"),
        "acquisition": values.number("FrameAcquisitionNumber", "AcquisitionNumber"),
        "trigger time": values.number("TriggerTime", "NominalCardiacTriggerDelayTime"),
        "time": _time(values),
    }
    return {name: key for name, key in keys.items() if key is not None and key != ""}


def _time(values: _Values) -> str:
    """When the picture was taken, as a text that sorts."""
    whole = ("FrameReferenceDateTime", "FrameAcquisitionDateTime", "AcquisitionDateTime")
    if moment := next((text for text in map(values.text, whole) if text), ""):
        return moment
    clock = next((text for text in map(values.text, ("AcquisitionTime", "ContentTime", "SeriesTime")) if text), "")
    return f"{values.text('AcquisitionDate')}{clock}" if clock else ""
