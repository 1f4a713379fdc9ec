"""Numbers of mammogram headers: written strangely, in other units, impossible, or none."""

from pathlib import Path

import pytest
from pydicom import config
from pydicom.datadict import dictionary_VR, tag_for_keyword
from pydicom.dataelem import DataElement
from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from stages.cohort.readers.header_values import number
from stages.cohort.readers.mammogram.numbers import Numbers
from stages.cohort.readers.mammogram.projection_angle import projection_angle


def _numbers(row=None, **elements):
    header = Dataset()
    for keyword, value in elements.items():
        header.add(DataElement(tag_for_keyword(keyword), dictionary_VR(keyword), "", validation_mode=config.IGNORE))
        # As read from a file: a raw text, which pydicom would turn into a number when asked for.
        header[keyword]._value = value
    return Numbers(Path("cc.dcm"), header, row or {})


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("72", 72.0),
        ("72,0", 72.0),
        ("-45,5", -45.5),
        ("0,085", 0.085),
        ("1e2", 100.0),
        ("1,234", None),
        ("nan", None),
        ("-inf", None),
        ("1e999", None),
        ("Anonymized", None),
        ("7.2 cm", None),
        ("", None),
    ],
)
def test_numbers_as_written(written, value):
    found = number(written)
    assert (found and found.value) == value


def test_a_decimal_comma_is_read_and_said():
    numbers = _numbers(ImagerPixelSpacing=["0,2", "0,2"], BodyPartThickness="72,0", PositionerPrimaryAngle="45,0")
    assert (numbers.pixel_mm(), numbers.thickness_mm(), numbers.angle_deg("MLO")) == (0.2, 72.0, 45.0)
    assert len(numbers.flags) == 3
    assert all("decimal comma" in flag for flag in numbers.flags)


def test_one_spacing_holds_for_both_directions_and_is_said():
    numbers = _numbers(ImagerPixelSpacing="0.2")
    assert numbers.pixel_mm() == 0.2
    assert numbers.flags == ["ImagerPixelSpacing 0.2 holds for both directions"]


@pytest.mark.parametrize("bad", ["Anonymized", "nan", "inf", "1,234", "--"])
@pytest.mark.parametrize(
    ("keyword", "column", "read", "value"),
    [
        ("ImagerPixelSpacing", "pixel_spacing_mm", lambda n: n.pixel_mm(), 0.1),
        ("PixelSpacing", "pixel_spacing_mm", lambda n: n.pixel_mm(), 0.1),
        ("BodyPartThickness", "thickness_mm", lambda n: n.thickness_mm(), 60.0),
        ("PositionerPrimaryAngle", "angle_deg", lambda n: n.angle_deg("MLO"), 50.0),
        ("DistanceSourceToDetector", "source_detector_mm", lambda n: n.source_detector_mm(), 650.0),
    ],
)
def test_no_number_names_field_and_column_and_the_column_overrides_it(bad, keyword, column, read, value):
    with pytest.raises(DataError, match=rf"cc\.dcm: {keyword} .* is not a .*column {column}"):
        read(_numbers(**{keyword: bad}))
    overridden = _numbers({column: str(value)}, **{keyword: bad})
    assert read(overridden) == value
    assert overridden.flags == []


@pytest.mark.parametrize("bad", ["Anonymized", "nan", "-3"])
def test_numbers_that_no_result_rests_on_are_flagged_and_left_out(bad):
    force = _numbers(CompressionForce=bad)
    assert force.force_n() is None
    assert "CompressionForce" in force.flags[0]
    support = _numbers(DistanceSourceToDetector="650", DistanceSourceToPatient=bad)
    assert support.support_detector_mm() is None
    assert "DistanceSourceToPatient" in support.flags[0]


@pytest.mark.parametrize(
    ("written", "thickness", "unit"), [("7.2", 72.0, "cm"), ("5", 50.0, "cm"), ("0.072", 72.0, "m"), ("31", 31.0, "")]
)
def test_thickness_in_another_unit_is_recognised(written, thickness, unit):
    numbers = _numbers(BodyPartThickness=written)
    assert numbers.thickness_mm() == pytest.approx(thickness)
    assert numbers.flags == ([f"BodyPartThickness {written} read as {unit}"] if unit else [])


@pytest.mark.parametrize("written", ["720", "72000", "0.5", "-50"])
def test_impossible_thickness_is_a_fault(written):
    with pytest.raises(DataError, match="column thickness_mm"):
        _numbers(BodyPartThickness=written).thickness_mm()


def test_a_column_is_in_millimetres():
    with pytest.raises(DataError, match=r"thickness_mm 7.2 is impossible \(10 to 160 mm\)"):
        _numbers({"thickness_mm": "7.2"}).thickness_mm()


@pytest.mark.parametrize("spacing", ["0.001", "10", "100", "-0.1"])
def test_impossible_spacing_is_a_fault(spacing):
    with pytest.raises(DataError, match="column pixel_spacing_mm"):
        _numbers(ImagerPixelSpacing=[spacing, spacing]).pixel_mm()


def test_source_distances_in_centimetres():
    numbers = _numbers(DistanceSourceToDetector="65", DistanceSourceToPatient="63")
    assert (numbers.source_detector_mm(), numbers.support_detector_mm()) == (650.0, 20.0)
    assert numbers.flags == ["DistanceSourceToDetector 65 read as cm", "DistanceSourceToPatient 63 read as cm"]


def test_scanned_film_has_its_spacing_at_the_detector():
    assert _numbers(NominalScannedPixelSpacing=["0.05", "0.05"]).pixel_mm() == 0.05


def test_pixel_spacing_without_magnification_is_said():
    numbers = _numbers(PixelSpacing=["0.1", "0.1"])
    assert numbers.pixel_mm() == 0.1
    assert numbers.flags == ["PixelSpacing taken for that at the detector"]


@pytest.mark.parametrize(
    ("value", "view", "angle", "remark"),
    [
        (45.0, "MLO", 45.0, ""),
        (-50.0, "MLO", 50.0, "absolute value"),
        (315.0, "MLO", 45.0, "absolute value"),
        (90.0, "ML", 90.0, ""),
        (-88.0, "ML", 88.0, "absolute value"),
        (90.0, "LM", -90.0, ""),
        (-90.0, "LM", -90.0, ""),
        (270.0, "LM", -90.0, ""),
        (135.0, "LMO", -135.0, ""),
        (-130.0, "LMO", -130.0, ""),
        (225.0, "LMO", -135.0, ""),
        (45.0, "LMO", -135.0, "below"),
        (180.0, "FB", 180.0, ""),
        (-175.0, "FB", 185.0, ""),
        (0.0, "FB", 180.0, ""),
        (5.0, "FB", 185.0, "below"),
        (-4.0, "CC", -4.0, ""),
        (7.0, "XCCL", 7.0, ""),
    ],
)
def test_angles_of_all_views(value, view, angle, remark):
    found, said = projection_angle(value, view)
    assert found == pytest.approx(angle)
    assert (remark in said) if remark else said == ""


@pytest.mark.parametrize(
    ("value", "view"), [(75, "CC"), (5, "MLO"), (45, "ML"), (45, "LM"), (90, "LMO"), (90, "FB"), (45, "XCCM")]
)
def test_angles_that_a_view_is_not_taken_at(value, view):
    with pytest.raises(DataError, match=f"impossible in {view}"):
        _numbers(PositionerPrimaryAngle=str(value)).angle_deg(view)


@pytest.mark.parametrize(("view", "angle"), [("MLO", None), ("ML", None), ("LM", None), ("CC", 0.0), ("FB", 180.0)])
def test_an_angle_of_zero_is_unknown_where_it_cannot_be_meant(view, angle):
    assert _numbers(PositionerPrimaryAngle="0").angle_deg(view) == angle
