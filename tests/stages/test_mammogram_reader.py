"""Reading mammograms: headers, overrides of the table, and what cannot be used."""

import numpy as np
import pytest
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid
from skimage.io import imsave

from mammoreg.errors import DataError
from stages.cohort.readers.mammogram.image import read_mammogram, read_mammogram_facts


def _dicom(path, **changes):
    """A small DICOM mammogram with a full header; a change of None removes the element."""
    header = Dataset()
    header.file_meta = FileMetaDataset()
    header.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    header.SOPClassUID = header.file_meta.MediaStorageSOPClassUID = "1.2.840.10008.5.1.4.1.1.1.2"
    header.SOPInstanceUID = header.file_meta.MediaStorageSOPInstanceUID = generate_uid(entropy_srcs=["mammogram"])
    pixels = np.zeros((600, 300), dtype=np.uint16)
    pixels[50:350, 150:] = 900
    elements = {
        "Modality": "MG", "PatientName": "SECRET^NAME", "PatientID": "SECRET-ID",
        "ViewPosition": "CC", "ImageLaterality": "R", "PatientOrientation": ["P", "L"],
        "ImagerPixelSpacing": [0.1, 0.1], "BodyPartThickness": 55, "CompressionForce": 120,
        "PositionerPrimaryAngle": 0, "DistanceSourceToDetector": 660, "DistanceSourceToPatient": 640,
        "PresentationIntentType": "FOR PRESENTATION", "PhotometricInterpretation": "MONOCHROME2",
        "SamplesPerPixel": 1, "Rows": 600, "Columns": 300, "BitsAllocated": 16, "BitsStored": 12, "HighBit": 11,
        "PixelRepresentation": 0, "PixelData": pixels.tobytes(),
    } | changes  # fmt: skip
    for keyword, value in elements.items():
        if value is not None:
            setattr(header, keyword, value)
    header.save_as(path, enforce_file_format=True)
    return path


def test_full_header(tmp_path):
    stored = read_mammogram(_dicom(tmp_path / "a.dcm"), {}, "R", "CC")
    facts = stored.facts
    assert stored.pixels.dtype == np.float32
    assert stored.pixels[200, 200] == 900.0
    assert facts.orientation == "P\\L"
    assert (facts.pixel_mm, facts.thickness_mm, facts.force_n, facts.angle_deg) == (0.1, 55.0, 120.0, 0.0)
    assert (facts.source_detector_mm, facts.support_detector_mm) == (660.0, 20.0)
    assert facts.estimated == facts.flags == ()
    assert "SECRET" not in repr(facts)


def test_what_the_header_lacks_is_estimated_and_named(tmp_path):
    lacking = ("BodyPartThickness", "CompressionForce", "DistanceSourceToDetector", "PositionerPrimaryAngle")
    path = _dicom(tmp_path / "a.dcm", ViewPosition="MLO", **dict.fromkeys(lacking))
    facts = read_mammogram_facts(path, {}, "R", "MLO")
    assert facts.estimated == (
        "thickness_mm", "force_n", "angle_deg", "source_detector_mm", "support_detector_mm",
    )  # fmt: skip
    assert (facts.angle_deg, facts.source_detector_mm, facts.support_detector_mm) == (45.0, 650.0, 15.0)


def test_zero_thickness_means_unknown(tmp_path):
    assert read_mammogram_facts(_dicom(tmp_path / "a.dcm", BodyPartThickness=0), {}, "R", "CC").thickness_mm is None


def test_table_overrides_the_header(tmp_path):
    row = {
        "pixel_spacing_mm": "0.085", "thickness_mm": "61", "force_n": "99", "angle_deg": "-3",
        "source_detector_mm": "700", "orientation": "A\\L",
    }  # fmt: skip
    facts = read_mammogram_facts(_dicom(tmp_path / "a.dcm"), row, "R", "CC")
    assert (facts.pixel_mm, facts.thickness_mm, facts.force_n, facts.angle_deg) == (0.085, 61.0, 99.0, -3.0)
    assert (facts.source_detector_mm, facts.orientation) == (700.0, "A\\L")


def test_force_in_decinewton_is_recognised(tmp_path):
    facts = read_mammogram_facts(_dicom(tmp_path / "a.dcm", CompressionForce=1180), {}, "R", "CC")
    assert facts.force_n == pytest.approx(118.0)
    assert facts.flags == ("CompressionForce 1180 read as dN",)


def test_negative_mlo_angle_only_warns(tmp_path):
    path = _dicom(tmp_path / "a.dcm", ViewPosition="MLO", PositionerPrimaryAngle=-50)
    facts = read_mammogram_facts(path, {}, "R", "MLO")
    assert facts.angle_deg == 50.0
    assert "negative angle" in facts.flags[0]


def test_pixel_spacing_in_the_patient_is_magnified_to_the_detector(tmp_path):
    path = _dicom(
        tmp_path / "a.dcm",
        ImagerPixelSpacing=None,
        PixelSpacing=[0.1, 0.1],
        EstimatedRadiographicMagnificationFactor=1.05,
    )
    assert read_mammogram_facts(path, {}, "R", "CC").pixel_mm == pytest.approx(0.105)


def test_padding_counts_as_air(tmp_path):
    pixels = np.full((600, 300), 5, dtype=np.uint16)
    pixels[50:350, 150:], pixels[:, 0] = 900, 4000
    path = _dicom(tmp_path / "a.dcm", PixelData=pixels.tobytes(), PixelPaddingValue=4000)
    assert read_mammogram(path, {}, "R", "CC").pixels.max() == 900.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ImageLaterality": "L"}, "ImageLaterality is L, the table's laterality is R"),
        ({"ViewPosition": "MLO"}, "ViewPosition is MLO, the table's view is CC"),
        ({"PatientOrientation": ["L", "P"]}, "antero-posterior"),
        ({"PatientOrientation": ["P", "F"]}, "does not tell the row order"),
        ({"Modality": "MR"}, "modality is MR, not MG"),
        ({"ImagerPixelSpacing": [0.0, 0.0]}, "not positive"),
        ({"ImagerPixelSpacing": [0.1, 0.2]}, "not square"),
        ({"PositionerPrimaryAngle": 75}, "impossible in CC"),
        ({"NumberOfFrames": 3}, "several frames"),
        ({"BodyPartThickness": -5}, "thickness_mm -5 is not positive"),
        ({"PixelData": b"\x00\x00" * 40}, "truncated"),
        ({"PixelData": None}, "truncated"),
    ],
)
def test_header_that_cannot_be_used(tmp_path, changes, words):
    path = _dicom(tmp_path / "a.dcm", **changes)
    with pytest.raises(DataError, match=words) as caught:
        read_mammogram(path, {}, "R", "CC")
    assert "SECRET" not in str(caught.value)


@pytest.mark.parametrize(("spacing", "size"), [(0.01, "7 mm"), (1.0, "700 mm")])
def test_a_scale_that_makes_no_mammogram_is_refused(tmp_path, spacing, size):
    path = _dicom(tmp_path / "a.dcm", ImagerPixelSpacing=[spacing, spacing], Rows=700, Columns=100)
    with pytest.raises(DataError, match=f"make an image of {size}"):
        read_mammogram_facts(path, {}, "R", "CC")
    assert read_mammogram_facts(path, {"pixel_spacing_mm": "0.3"}, "R", "CC").pixel_mm == 0.3


def test_number_of_the_table_that_is_none(tmp_path):
    with pytest.raises(DataError, match=r"thickness_mm '5 cm' of a\.dcm is not a number"):
        read_mammogram_facts(_dicom(tmp_path / "a.dcm"), {"thickness_mm": "5 cm"}, "R", "CC")


@pytest.mark.parametrize("name", ["missing.dcm", "missing.png", "text.dcm", "text.png"])
def test_unreadable_file(tmp_path, name):
    if name.startswith("text"):
        (tmp_path / name).write_text("no image")
    with pytest.raises(DataError, match="cannot be (read|opened)"):
        read_mammogram(tmp_path / name, {}, "R", "CC")


def test_colour_picture_is_refused_and_grey_rgb_is_read(tmp_path):
    colour = np.zeros((20, 20, 3), dtype=np.uint8)
    colour[5:, 5:] = 100
    imsave(tmp_path / "grey.png", colour, check_contrast=False)
    assert read_mammogram(tmp_path / "grey.png", {}, "R", "CC").pixels.shape == (20, 20)
    colour[5:, 5:, 1] = 200
    imsave(tmp_path / "colour.png", colour, check_contrast=False)
    with pytest.raises(DataError, match="colour picture"):
        read_mammogram(tmp_path / "colour.png", {}, "R", "CC")


def _view_code(value):
    code = Dataset()
    code.CodeValue, code.CodingSchemeDesignator, code.CodeMeaning = value, "SCT", ""
    return [code]


def test_a_view_that_only_the_code_names_is_held_against_the_table(tmp_path):
    path = _dicom(tmp_path / "a.dcm", ViewPosition=None, ViewCodeSequence=_view_code("399368009"))
    with pytest.raises(DataError, match="the header's ViewCodeSequence is MLO, the table's view is CC"):
        read_mammogram_facts(path, {}, "R", "CC")
    assert read_mammogram_facts(path, {"angle_deg": "45"}, "R", "MLO").flags == ()


@pytest.mark.parametrize(
    "elements",
    [{"ViewPosition": "RIGHT CC"}, {"ViewPosition": "RCC"}, {"ImageLaterality": "RIGHT"}, {"PatientOrientation": "CC"}],
)
def test_what_vendors_write_for_side_and_view_agrees_with_the_table(tmp_path, elements):
    path = _dicom(tmp_path / "a.dcm", **elements)
    assert read_mammogram_facts(path, {}, "R", "CC").flags == ()
    with pytest.raises(DataError, match="the table's"):
        read_mammogram_facts(path, {}, "L", "MLO")


def test_views_that_the_model_does_not_know_are_refused_or_flagged(tmp_path):
    path = _dicom(tmp_path / "a.dcm", ViewPosition="MCC")
    with pytest.raises(DataError, match="is a magnification view, which cannot be registered; name a plain view"):
        read_mammogram_facts(path, {}, "R", "CC")
    path = _dicom(tmp_path / "b.dcm", BreastImplantPresent="YES", PartialView="YES", ViewPosition="XCCL")
    flags = read_mammogram_facts(path, {}, "R", "XCCL").flags
    assert flags[0].startswith("exaggerated view")
    assert flags[1].startswith("breast implant")
    assert flags[2].startswith("partial view")
