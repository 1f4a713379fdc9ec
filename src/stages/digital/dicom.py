"""Files of a digital patient in a hospital's formats, the same bytes for the same contents."""

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import (
    UID,
    DigitalMammographyXRayImageStorageForPresentation,
    ExplicitVRLittleEndian,
    MRImageStorage,
    generate_uid,
)

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.views import PROJECTIONS, View
from stages.engine.contract import Subject
from stages.formats.images import mask_png
from stages.formats.nifti import nifti_bytes, volume_affine

VIEW_CODES: dict[View, str] = {
    "CC": "R-10242",
    "MLO": "R-10226",
    "ML": "R-10224",
    "LM": "R-10228",
    "LMO": "R-10230",
    "XCCL": "R-1024A",
    "XCCM": "R-1024B",
    "FB": "R-10244",
}


def nifti(volume: Volume, laterality: Laterality, sagittal: bool = False) -> bytes:
    """A breast-frame volume as compressed NIfTI, its planes axial or sagittal."""
    lps = volume.to_lps(laterality)
    data, affine = np.asarray(lps.data), volume_affine(lps)
    if sagittal:
        data, affine = np.ascontiguousarray(data.transpose(1, 2, 0)), affine[:, [1, 2, 0, 3]]
    return nifti_bytes(data, affine)


def mr_dicom(volume: Volume, subject: Subject) -> list[bytes]:
    """A breast-frame volume as one DICOM series of axial slices, from inferior to superior."""
    lps = volume.to_lps(subject.laterality)
    data = np.asarray(lps.data)
    return [_mr_slice(lps, data[:, :, k], k, subject) for k in range(data.shape[2])]


def _mr_slice(lps: Volume, plane: NDArray[np.generic], number: int, subject: Subject) -> bytes:
    """One axial slice of samples (right to left, front to back)."""
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    _identify(dataset, subject, "MR", MRImageStorage, number + 1)
    dataset.FrameOfReferenceUID = generate_uid(entropy_srcs=[f"DIGITAL-{subject.case}", "frame"])
    dataset.Modality, dataset.BodyPartExamined = "MR", "BREAST"
    dataset.Manufacturer, dataset.PatientPosition = "digital patient (simulated)", "HFP"
    dataset.ScanningSequence, dataset.SequenceVariant, dataset.ScanOptions = "GR", "SP", ""
    dataset.MRAcquisitionType, dataset.SliceThickness = "3D", f"{lps.spacing[2]:.2f}"
    place = [*lps.origin[:2], lps.origin[2] + number * lps.spacing[2]]
    dataset.ImagePositionPatient = [f"{value:.4f}" for value in place]
    dataset.ImageOrientationPatient = ["1", "0", "0", "0", "1", "0"]
    dataset.PixelSpacing = [f"{lps.spacing[1]:.2f}", f"{lps.spacing[0]:.2f}"]
    _describe_samples(dataset, plane.T, "MONOCHROME2", 16)
    return _written(dataset)


def points_tsv(names: Sequence[str], points: NDArray[np.float64], columns: tuple[str, ...]) -> bytes:
    """A table of named points, two decimals."""
    lines = ["\t".join(("name", *columns))]
    lines += ["\t".join((n, *(f"{value:.2f}" for value in row))) for n, row in zip(names, points, strict=True)]
    return ("\n".join(lines) + "\n").encode()


def _orientation(laterality: Laterality, view: View) -> list[str]:
    """PatientOrientation of an image as `_stored` turns it."""
    sides = {"M": "R", "T": "L"} if laterality == "L" else {"M": "L", "T": "R"}
    rows = sorted(PROJECTIONS[view].rows_towards - set(sides))
    across = [sides[letter] for letter in PROJECTIONS[view].rows_towards if letter in sides]
    return ["A" if laterality == "L" else "P", "".join([*rows, *across])]


def _stored(image: NDArray[np.generic], laterality: Laterality) -> NDArray[np.generic]:
    """A canonical image (chest wall at column 0) as it is usually stored: a right breast's columns reversed."""
    return np.ascontiguousarray(image[:, ::-1] if laterality == "R" else image)


def stored_mask(mask: NDArray[np.bool_], laterality: Laterality) -> bytes:
    """A canonical mask as PNG in stored orientation, 255 inside."""
    return mask_png(_stored(mask, laterality))


def mammogram_dicom(
    image: NDArray[np.uint16],
    subject: Subject,
    view: View,
    geometry: ViewGeometry,
    thickness_mm: float,
    force_n: float,
    monochrome1: bool,
) -> bytes:
    """A canonical image as DICOM mammogram; the header holds what a machine knows, not the truth."""
    pixels = _stored(4095 - image if monochrome1 else image, subject.laterality)
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    _identify(dataset, subject, view, DigitalMammographyXRayImageStorageForPresentation, 1)
    _describe_view(dataset, subject, view)
    _describe_machine(dataset, geometry, view)
    dataset.BodyPartThickness = f"{thickness_mm:.0f}"
    dataset.CompressionForce = f"{force_n:.1f}"
    dataset.PatientOrientation = _orientation(subject.laterality, view)
    _describe_pixels(dataset, pixels, geometry.pixel_mm, monochrome1)
    return _written(dataset)


def _written(dataset: Dataset) -> bytes:
    buffer = io.BytesIO()
    dataset.save_as(buffer, enforce_file_format=True)
    return buffer.getvalue()


def _identify(dataset: Dataset, subject: Subject, series: str, kind: UID, number: int) -> None:
    """Identifiers that follow from the case's name, the series and the image's number in it; no dates."""
    patient = f"DIGITAL-{subject.case}"
    dataset.SOPClassUID = kind
    dataset.SOPInstanceUID = generate_uid(entropy_srcs=[patient, series, f"instance {number}"])
    dataset.StudyInstanceUID = generate_uid(entropy_srcs=[patient, "study"])
    dataset.SeriesInstanceUID = generate_uid(entropy_srcs=[patient, series, "series"])
    dataset.file_meta.MediaStorageSOPClassUID = dataset.SOPClassUID
    dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
    dataset.PatientName, dataset.PatientID = patient.upper(), patient.upper()
    dataset.PatientBirthDate, dataset.PatientSex, dataset.PatientIdentityRemoved = "", "F", "YES"
    dataset.StudyDate, dataset.StudyTime, dataset.AccessionNumber, dataset.StudyID = "", "", "", "1"
    dataset.ReferringPhysicianName, dataset.SeriesNumber, dataset.InstanceNumber = "", "1", str(number)


def _describe_view(dataset: Dataset, subject: Subject, view: View) -> None:
    dataset.ImageLaterality, dataset.ViewPosition = subject.laterality, view
    code = Dataset()
    code.CodeValue, code.CodeMeaning = VIEW_CODES[view], PROJECTIONS[view].name
    code.CodingSchemeDesignator = "SRT"
    dataset.ViewCodeSequence = [code]


def _describe_machine(dataset: Dataset, geometry: ViewGeometry, view: View) -> None:
    dataset.Modality, dataset.PresentationIntentType = "MG", "FOR PRESENTATION"
    dataset.ImageType = ["DERIVED", "PRIMARY"]
    dataset.Manufacturer, dataset.BodyPartExamined = "digital patient (simulated)", "BREAST"
    dataset.DetectorType, dataset.PositionerType = "DIRECT", "MAMMOGRAPHIC"
    dataset.PositionerPrimaryAngle = f"{PROJECTIONS[view].angle_deg:.0f}"
    dataset.DistanceSourceToDetector = f"{geometry.source_detector_mm:.0f}"
    dataset.DistanceSourceToPatient = f"{geometry.source_detector_mm - geometry.support_detector_mm:.0f}"
    dataset.EstimatedRadiographicMagnificationFactor = f"{geometry.middle_magnification:.4f}"
    dataset.BreastImplantPresent, dataset.PartialView, dataset.BurnedInAnnotation = "NO", "NO", "NO"


def _describe_pixels(dataset: Dataset, pixels: NDArray[np.generic], pixel_mm: float, monochrome1: bool) -> None:
    dataset.ImagerPixelSpacing = [pixel_mm, pixel_mm]
    dataset.PresentationLUTShape = "INVERSE" if monochrome1 else "IDENTITY"
    dataset.PixelIntensityRelationship, dataset.PixelIntensityRelationshipSign = "LOG", 1 if monochrome1 else -1
    dataset.WindowCenter, dataset.WindowWidth = "2048", "4096"
    dataset.RescaleIntercept, dataset.RescaleSlope, dataset.RescaleType = "0", "1", "US"
    dataset.LossyImageCompression = "00"
    _describe_samples(dataset, pixels, "MONOCHROME1" if monochrome1 else "MONOCHROME2", 12)


def _describe_samples(dataset: Dataset, pixels: NDArray[np.generic], interpretation: str, bits: int) -> None:
    dataset.Rows, dataset.Columns = pixels.shape
    dataset.SamplesPerPixel, dataset.PixelRepresentation = 1, 0
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = 16, bits, bits - 1
    dataset.PhotometricInterpretation = interpretation
    dataset.PixelData = np.ascontiguousarray(pixels).astype("<u2").tobytes()
