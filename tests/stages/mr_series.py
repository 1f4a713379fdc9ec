"""MR pictures as scanners write them, tiny, to be put into folders in every disorder."""

import copy
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.fileset import FileSet
from pydicom.sequence import Sequence as Items
from pydicom.uid import EnhancedMRImageStorage, ExplicitVRLittleEndian, MRImageStorage, generate_uid

AXIAL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
SAGITTAL = ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
ROWS, COLUMNS = 12, 10
PIXEL_MM = 1.5

Field = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def linear_field(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intensities that linear interpolation meets exactly."""
    return np.asarray(300.0 + points @ np.array([1.0, -2.0, 0.5]))


def series(
    name: str,
    *,
    count: int = 9,
    step_mm: float = 2.0,
    start: Sequence[float] = (-10.0, -8.0, 5.0),
    axes: tuple[Sequence[float], Sequence[float]] = AXIAL,
    slope: float = 0.5,
    field: Field = linear_field,
    study: str = "exam",
    patient: str = "Doe^Jane",
    **elements: object,
) -> list[Dataset]:
    """Slices of one series, a gradient echo before contrast unless `elements` say otherwise; None removes one.

    Args:
        name: what the series' UID and description are made of.
        count, step_mm, start, axes: slices from the first pixel of the first one along the normal.
        slope: RescaleSlope, of every second slice twice as much.
        field: intensities at LPS points.
        study, patient: what their identifiers are made of.
        elements: further elements of each header.
    """
    row, column = np.array(axes[0]), np.array(axes[1])
    normal = np.cross(row, column)
    slices = []
    for number in range(count):
        place = np.array(start) + number * step_mm * normal
        down, across = np.mgrid[:ROWS, :COLUMNS]
        points = place + PIXEL_MM * (across[..., None] * row + down[..., None] * column)
        scale = slope * (1 + number % 2)
        header = _header(name, number, study, patient)
        header.ImagePositionPatient = [f"{v:.5f}" for v in place]
        header.ImageOrientationPatient = [f"{v:.6f}" for v in (*row, *column)]
        header.RescaleSlope, header.RescaleIntercept = scale, -100.0
        header.PixelData = np.round((field(points) + 100.0) / scale).astype("<u2").tobytes()
        header.SpacingBetweenSlices = header.SliceThickness = step_mm
        for keyword, value in elements.items():
            if value is None:
                if keyword in header:
                    delattr(header, keyword)
            else:
                setattr(header, keyword, value)
        slices.append(header)
    return slices


def _header(name: str, number: int, study: str, patient: str) -> Dataset:
    header = Dataset()
    header.file_meta = FileMetaDataset()
    header.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    header.file_meta.MediaStorageSOPClassUID = header.SOPClassUID = MRImageStorage
    header.SOPInstanceUID = generate_uid(entropy_srcs=[patient, study, name, str(number)])
    header.file_meta.MediaStorageSOPInstanceUID = header.SOPInstanceUID
    header.SeriesInstanceUID = generate_uid(entropy_srcs=[patient, study, name])
    header.StudyInstanceUID = generate_uid(entropy_srcs=[patient, study])
    header.FrameOfReferenceUID = generate_uid(entropy_srcs=[patient, study, "frame"])
    header.PatientName, header.PatientID, header.PatientBirthDate = patient, f"ID-{patient}", "19700101"
    header.StudyDate, header.StudyTime, header.StudyID, header.AccessionNumber = "20180512", "101500", "1", "A77"
    header.Modality, header.SeriesDescription, header.SeriesNumber = "MR", name, 1
    header.ImageType, header.InstanceNumber = ["ORIGINAL", "PRIMARY", "M", "NORM"], number + 1
    header.ScanningSequence, header.MRAcquisitionType = "GR", "3D"
    header.EchoTime, header.RepetitionTime, header.AcquisitionTime = 1.7, 4.3, "101500"
    header.Rows, header.Columns, header.PixelSpacing = ROWS, COLUMNS, [PIXEL_MM, PIXEL_MM]
    header.SamplesPerPixel, header.PhotometricInterpretation = 1, "MONOCHROME2"
    header.BitsAllocated, header.BitsStored, header.HighBit, header.PixelRepresentation = 16, 16, 15, 0
    return header


def write(folder: Path, slices: Sequence[Dataset], prefix: str = "IM") -> Path:
    """Write slices under names without extension that do not follow their order."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, header in enumerate(slices):
        header.save_as(folder / f"{prefix}{(number * 7) % 101:04d}", enforce_file_format=True)
    return folder


def write_directory(folder: Path, files: Sequence[Path]) -> None:
    """A DICOMDIR that lists copies of these files, as on a patient's disc."""
    disc = FileSet()
    for path in files:
        disc.add(path)
    disc.write(folder)
    disc._stage["t"].cleanup()


def again(slices: Sequence[Dataset], **elements: object) -> list[Dataset]:
    """The same slices as other objects, with some elements changed."""
    found = copy.deepcopy(list(slices))
    for number, header in enumerate(found):
        header.SOPInstanceUID = generate_uid(entropy_srcs=[header.SOPInstanceUID, str(elements), str(number)])
        header.file_meta.MediaStorageSOPInstanceUID = header.SOPInstanceUID
        for keyword, value in elements.items():
            setattr(header, keyword, value)
    return found


def multi_frame(*volumes: Sequence[Dataset]) -> Dataset:
    """Classic slices as one Enhanced MR object; each volume is a temporal position of its own."""
    frames = [(phase, header) for phase, slices in enumerate(volumes, 1) for header in slices]
    first = copy.deepcopy(frames[0][1])
    first.SOPClassUID = first.file_meta.MediaStorageSOPClassUID = EnhancedMRImageStorage
    first.NumberOfFrames, first.PixelData = len(frames), b"".join(header.PixelData for _, header in frames)
    orientation = _item(ImageOrientationPatient=first.ImageOrientationPatient)
    measures = _item(PixelSpacing=first.PixelSpacing, SliceThickness=first.SliceThickness)
    first.SharedFunctionalGroupsSequence = [
        _item(PlaneOrientationSequence=[orientation], PixelMeasuresSequence=[measures])
    ]
    first.PerFrameFunctionalGroupsSequence = Items(
        _item(
            PlanePositionSequence=[_item(ImagePositionPatient=header.ImagePositionPatient)],
            FrameContentSequence=[_item(StackID="1", InStackPositionNumber=n + 1, TemporalPositionIndex=phase)],
            MREchoSequence=[_item(EffectiveEchoTime=float(header.EchoTime))],
            PixelValueTransformationSequence=[
                _item(RescaleSlope=header.RescaleSlope, RescaleIntercept=header.RescaleIntercept, RescaleType="US")
            ],
        )
        for n, (phase, header) in enumerate(frames)
    )
    for keyword in (
        *("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness", "SpacingBetweenSlices"),
        *("RescaleSlope", "RescaleIntercept", "EchoTime"),
    ):
        if keyword in first:
            delattr(first, keyword)
    return first


def _item(**elements: object) -> Dataset:
    item = Dataset()
    for keyword, value in elements.items():
        setattr(item, keyword, value)
    return item


def report(like: Dataset) -> Dataset:
    """A structured report of the same patient."""
    found = copy.deepcopy(like)
    found.Modality, found.SOPClassUID = "SR", "1.2.840.10008.5.1.4.1.1.88.22"
    found.file_meta.MediaStorageSOPClassUID = found.SOPClassUID
    found.SOPInstanceUID = found.file_meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=["report"])
    found.SeriesInstanceUID = generate_uid(entropy_srcs=["report", "series"])
    for keyword in ("PixelData", "ImagePositionPatient", "ImageOrientationPatient", "Rows", "Columns"):
        delattr(found, keyword)
    return found
