"""Padding, shutters and collimators become air, in every polarity; the breast stays."""

import numpy as np
import pytest
from pydicom.dataset import Dataset

from mammoreg.imaging.mammogram_canonical import canonicalise
from stages.cohort.readers.mammogram.outside import with_air_outside
from tests.unit.mammogram_images import breast_image

RAW = {
    "PresentationIntentType": "FOR PROCESSING",
    "PixelIntensityRelationship": "LIN",
    "PixelIntensityRelationshipSign": 1,
    "PhotometricInterpretation": "MONOCHROME1",
}
SHOWN = {"PresentationIntentType": "FOR PRESENTATION", "PhotometricInterpretation": "MONOCHROME2"}
INVERTED = SHOWN | {"PhotometricInterpretation": "MONOCHROME1"}


def _header(**elements):
    header = Dataset()
    for keyword, value in elements.items():
        setattr(header, keyword, value)
    return header


def _border(shape):
    """Bands above, below and at the nipple's side, and none at the chest wall (column 0)."""
    border = np.zeros(shape, dtype=bool)
    border[:20], border[-25:], border[:, -30:] = True, True, True
    return border


def _images():
    shown = breast_image().astype(np.float32)
    raw = np.float32(16000.0) * np.exp(-shown / 1100.0) + np.random.default_rng(0).normal(0, 8, shown.shape)
    return {"raw": (raw.astype(np.float32), RAW), "shown": (shown, SHOWN), "inverted": (4095.0 - shown, INVERTED)}


@pytest.mark.parametrize("kind", ["raw", "shown", "inverted"])
@pytest.mark.parametrize("padding", [0.0, 20000.0])
def test_padding_of_any_value_becomes_air(kind, padding):
    image, header = _images()[kind]
    border = _border(image.shape)
    stored = np.where(border, np.float32(padding), image)
    found = with_air_outside(stored, _header(**header, PixelPaddingValue=int(padding)), linear=kind == "raw")
    air = float(np.median(image[:, -60:]))
    reach = float(np.ptp(image))
    assert np.abs(found[border] - air).max() < 0.01 * reach
    kept = ~border & (stored != padding)
    assert np.array_equal(found[kept], image[kept])


def test_a_range_of_padding_becomes_air():
    image, header = _images()["shown"]
    stored = np.where(_border(image.shape), np.random.default_rng(1).integers(5000, 5011, image.shape), image)
    found = with_air_outside(
        stored.astype(np.float32), _header(**header, PixelPaddingValue=5000, PixelPaddingRangeLimit=5010), False
    )
    assert found.max() <= image.max()


def test_padding_that_is_the_whole_air_stays_at_its_side_of_the_grey_values():
    image, header = _images()["shown"]
    stored = np.where(image < 150, np.float32(0.0), image)
    found = with_air_outside(stored, _header(**header, PixelPaddingValue=0), False)
    assert found.max() == image.max()
    assert found[stored == 0.0].max() <= stored[stored > 0.0].min()


@pytest.mark.parametrize("kind", ["Shutter", "Collimator"])
def test_what_a_declared_edge_hides_becomes_air(kind):
    image, header = _images()["shown"]
    border = _border(image.shape)
    stored = np.where(border, np.float32(4000.0), image)
    edges = dict(
        zip(
            ("UpperHorizontalEdge", "LowerHorizontalEdge", "LeftVerticalEdge", "RightVerticalEdge"),
            (21, image.shape[0] - 25, 1, image.shape[1] - 30),
            strict=True,
        )
    )
    declared = {f"{kind}{name}": value for name, value in edges.items()} | {f"{kind}Shape": "RECTANGULAR"}
    found = with_air_outside(stored, _header(**header, **declared), False)
    assert np.abs(found[border] - np.median(image[:, -60:])).max() < 0.01 * np.ptp(image)
    assert np.array_equal(found[~border], image[~border])


def test_an_undeclared_dark_border_of_raw_data_becomes_air():
    image, header = _images()["raw"]
    border = _border(image.shape)
    stored = np.where(border, np.float32(0.0), image)
    found = with_air_outside(stored, _header(**header), linear=True)
    plain, bordered = (canonicalise(p, "L", "CC", orientation="A\\R", linear=True).pixels for p in (image, found))
    assert np.abs(bordered[border]).max() < 0.01 * np.ptp(plain)
    assert np.abs(bordered - plain)[~border].max() < 0.01 * np.ptp(plain)


def test_raw_data_without_border_stay_as_they_are():
    image, header = _images()["raw"]
    assert np.array_equal(with_air_outside(image, _header(**header), linear=True), image)


def test_signed_padding_written_unsigned():
    image, header = _images()["shown"]
    stored = np.where(_border(image.shape), np.float32(-2000.0), image)
    declared = {"PixelRepresentation": 1, "BitsAllocated": 16, "PixelPaddingValue": 63536}
    found = with_air_outside(stored, _header(**header, **declared), False)
    assert found.min() >= image.min()
