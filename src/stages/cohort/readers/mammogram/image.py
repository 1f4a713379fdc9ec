"""Mammograms from DICOM, PNG and TIFF files; nothing that identifies a patient is kept."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.views import View
from stages.cohort.readers.dicom_headers import read_dicom
from stages.cohort.readers.header_values import number, texts
from stages.cohort.readers.mammogram.header import MammogramFacts, mammogram_facts
from stages.cohort.readers.mammogram.kind import lift_frame_values, other_kind
from stages.cohort.readers.mammogram.outside import with_air_outside

PICTURES = (".png", ".tif", ".tiff")
EXTENT_MM = (40.0, 600.0)
"""Longer side of a mammogram (chosen: detectors have 180 to 430 mm, and a crop is smaller)."""


@dataclass(frozen=True)
class StoredMammogram:
    """A mammogram as stored.

    Attributes:
        pixels: float32 (rows, columns), neither flipped nor inverted.
        facts: what header and table say.
    """

    pixels: NDArray[np.float32]
    facts: MammogramFacts


def read_mammogram(path: Path, row: Mapping[str, str], laterality: Laterality, view: View) -> StoredMammogram:
    """Read pixels and imaging facts of one mammogram.

    Args:
        path: DICOM file, PNG or TIFF.
        row: columns of views.tsv, which override the header or stand in for one.

    Raises:
        DataError: If the file cannot be read, is no mammogram, or contradicts the table.
    """
    header = Dataset() if is_picture(path) else _read_dicom(path, pixels=True)
    facts = mammogram_facts(path, header, row, laterality, view)
    pixels = _picture_pixels(path) if is_picture(path) else _dicom_pixels(path, header, facts.linear)
    _check_extent(path, pixels.shape, facts.pixel_mm)
    return StoredMammogram(pixels, facts)


def read_mammogram_facts(path: Path, row: Mapping[str, str], laterality: Laterality, view: View) -> MammogramFacts:
    """The imaging facts alone, without decoding pixels: what preflight asks for.

    Raises:
        DataError: As `read_mammogram`, but for faults of the pixels.
    """
    header = Dataset() if is_picture(path) else _read_dicom(path, pixels=False)
    facts = mammogram_facts(path, header, row, laterality, view)
    _check_extent(path, image_size(path), facts.pixel_mm)
    return facts


def image_size(path: Path) -> tuple[int, int]:
    """Rows and columns of a mammogram by its header.

    Raises:
        DataError: it tells none.
    """
    if is_picture(path):
        try:
            with Image.open(path) as picture:
                return picture.height, picture.width
        except (OSError, SyntaxError, ValueError) as error:
            raise DataError(f"{path}: cannot be read as a picture; export the image again") from error
    header = _read_dicom(path, pixels=False)
    size = [one.value for key in ("Rows", "Columns") if (one := number("".join(texts(header, key)[:1]))) is not None]
    if len(size) < 2 or min(size) < 1.0:
        raise DataError(f"{path}: the header gives no image size; export the image again")
    return int(size[0]), int(size[1])


def _check_extent(path: Path, shape: tuple[int, ...], pixel_mm: float | None) -> None:
    """Refuse a scale at which the image is no mammogram's size.

    Raises:
        DataError: with the remedy.
    """
    low, high = EXTENT_MM
    longest = max(shape) * pixel_mm if pixel_mm is not None else None
    if longest is not None and not low <= longest <= high:
        raise DataError(
            f"{path}: {max(shape)} pixels of {pixel_mm:g} mm make an image of {longest:.0f} mm, and a mammogram has "
            f"{low:.0f} to {high:.0f} mm; correct the pixel spacing or give the column pixel_spacing_mm"
        )


def is_picture(path: Path) -> bool:
    """Whether a file is taken for a PNG or TIFF picture, by its name."""
    return path.suffix.lower() in PICTURES


def _read_dicom(path: Path, *, pixels: bool) -> Dataset:
    header = read_dicom(path, pixels=pixels)
    if header is None:
        raise DataError(f"{path}: cannot be read as DICOM; name a DICOM mammogram, a .png or a .tif")
    lift_frame_values(header)
    if found := other_kind(header):
        raise DataError(f"{path}: {found}")
    return header


def _dicom_pixels(path: Path, header: Dataset, linear: bool) -> NDArray[np.float32]:
    try:
        pixels = np.asarray(header.pixel_array)
    except (NotImplementedError, RuntimeError):
        pixels = _decoded_by_itk(path)
    except Exception as error:  # pydicom raises many kinds for damaged pixels
        raise DataError(f"{path}: pixels are missing or truncated; export the image again") from error
    return with_air_outside(_one_channel(path, pixels), header, linear)


def _decoded_by_itk(path: Path) -> NDArray[Any]:
    """Pixels in a compression that needs GDCM, which SimpleITK brings."""
    import SimpleITK

    try:
        return np.asarray(SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(str(path)))[0])
    except RuntimeError as error:
        raise DataError(f"{path}: pixels cannot be decoded; export the image uncompressed") from error


def _picture_pixels(path: Path) -> NDArray[np.float32]:
    try:
        with Image.open(path) as picture:
            pixels = np.asarray(picture.convert("RGB") if picture.mode == "P" else picture)
    except (OSError, ValueError, SyntaxError) as error:
        raise DataError(f"{path}: cannot be read as a picture; export the image again as .png or .tif") from error
    return _one_channel(path, pixels)


def _one_channel(path: Path, pixels: NDArray[Any]) -> NDArray[np.float32]:
    if pixels.ndim == 3 and pixels.shape[2] in (2, 3, 4):
        grey = pixels[..., :1] if pixels.shape[2] == 2 else pixels[..., :3]
        if np.any(grey != grey[..., :1]):
            raise DataError(f"{path}: is a colour picture; export the mammogram in grey values")
        pixels = grey[..., 0]
    if pixels.ndim != 2:
        raise DataError(f"{path}: pixels of shape {pixels.shape} are no single image; export one mammogram a file")
    return pixels.astype(np.float32)
