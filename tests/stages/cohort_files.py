"""A small cohort on disk, whose files preflight accepts, to spoil one thing at a time."""

from pathlib import Path

import nibabel
import numpy as np
from PIL import Image
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

SHAPE = (12, 14, 16)
AFFINE = np.diag([-1.4, -1.4, 1.4, 1.0])
ROWS, COLUMNS = 40, 30


def write_tsv(path: Path, *rows: dict[str, str]) -> Path:
    """A table of these rows; columns are those of any row."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    lines = [columns, *[[row.get(column, "") for column in columns] for row in rows]]
    path.write_text("".join("\t".join(line) + "\n" for line in lines))
    return path


def write_volume(path: Path, data: np.ndarray | None = None, affine: np.ndarray = AFFINE) -> Path:
    """A NIfTI volume; without data one of noise."""
    samples = np.random.default_rng(1).normal(size=SHAPE).astype(np.float32) if data is None else data
    nibabel.save(nibabel.Nifti1Image(samples, affine), path)
    return path


def ball(shape: tuple[int, ...], *centres: tuple[int, ...], radius: float = 1.5) -> np.ndarray:
    """A mask with balls around these voxels."""
    index = np.indices(shape)
    distance = [np.sqrt(sum((i - c) ** 2 for i, c in zip(index, centre, strict=True))) for centre in centres]
    return (np.min(distance, axis=0) <= radius).astype(np.uint8)


def write_dicom(path: Path, **elements: object) -> Path:
    """A small DICOM mammogram, right CC, with these elements changed; None removes one."""
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = "1.2.840.10008.5.1.4.1.1.1.2", generate_uid()
    header = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    values: dict[str, object] = {
        "SOPClassUID": meta.MediaStorageSOPClassUID,
        "SOPInstanceUID": meta.MediaStorageSOPInstanceUID,
        "Modality": "MG",
        "ViewPosition": "CC",
        "ImageLaterality": "R",
        "PatientOrientation": ["P", "L"],
        "ImagerPixelSpacing": [1.0, 1.0],
        "BodyPartThickness": 50,
        "PhotometricInterpretation": "MONOCHROME2",
        "SamplesPerPixel": 1,
        "BitsAllocated": 16,
        "BitsStored": 12,
        "HighBit": 11,
        "PixelRepresentation": 0,
        "Rows": ROWS,
        "Columns": COLUMNS,
        "PixelData": np.zeros((ROWS, COLUMNS), np.uint16).tobytes(),
    }
    for keyword, value in (values | elements).items():
        if value is not None:
            setattr(header, keyword, value)
    header.save_as(path, enforce_file_format=True)
    return path


def write_cohort(folder: Path) -> Path:
    """Tables `cases.tsv` and `views.tsv` of one case with every kind of file."""
    write_volume(folder / "mr.nii.gz")
    write_volume(folder / "mr_lesion.nii.gz", ball(SHAPE, (5, 6, 7)))
    write_volume(folder / "mr_labels.nii.gz", np.ones(SHAPE, np.uint8))
    points = ({"name": "P1", "x": "1", "y": "2", "z": "3"}, {"name": "P2", "x": "4", "y": "5", "z": "6"})
    write_tsv(folder / "points.tsv", *points)
    write_tsv(folder / "pixels.tsv", {"name": "P1", "column": "3", "row": "4"})
    write_dicom(folder / "cc.dcm")
    Image.fromarray(255 * ball((ROWS, COLUMNS), (20, 10))).save(folder / "lesion.png")
    files = {"mr": "mr.nii.gz", "mr_lesion": "mr_lesion.nii.gz", "mr_labels": "mr_labels.nii.gz"}
    marks = {"mr_landmarks": "points.tsv"}
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", **files, **marks})
    view = {"case": "c1", "view": "CC", "image": "cc.dcm", "lesion": "lesion.png", "landmarks": "pixels.tsv"}
    write_tsv(folder / "views.tsv", view)
    return folder
