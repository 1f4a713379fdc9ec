"""Side and view in headers: as codes, as vendors spell them, and what cannot be registered."""

import pytest
from pydicom import config
from pydicom.datadict import dictionary_VR, tag_for_keyword
from pydicom.dataelem import DataElement
from pydicom.dataset import Dataset

from stages.cohort.readers.mammogram.view_codes import IMPLANT, PARTIAL, side_and_view
from stages.cohort.readers.mammogram.view_words import read_words


def _item(value, scheme="SRT", meaning=""):
    item = Dataset()
    item.CodeValue, item.CodingSchemeDesignator, item.CodeMeaning = value, scheme, meaning
    return item


def _header(**elements):
    header = Dataset()
    for keyword, value in elements.items():
        # Unchecked, as a file's: vendors write what the standard does not permit.
        element = DataElement(tag_for_keyword(keyword), dictionary_VR(keyword), value, validation_mode=config.IGNORE)
        header.add(element)
    return header


def _coded(view, *modifiers, scheme="SRT"):
    code = _item(view, scheme)
    if modifiers:
        code.ViewModifierCodeSequence = [_item(value, scheme) for value in modifiers]
    return _header(ViewCodeSequence=[code])


@pytest.mark.parametrize(
    ("text", "side", "view"),
    [
        ("RIGHT CC", "R", "CC"),
        ("RCC", "R", "CC"),
        ("R CC", "R", "CC"),
        ("R-CC", "R", "CC"),
        ("cc", None, "CC"),
        ("LMLO", "L", "MLO"),
        ("LMO", None, "LMO"),
        ("L LMO", "L", "LMO"),
        ("LML", "L", "ML"),
        ("LM", None, "LM"),
        ("LLM", "L", "LM"),
        ("RXCCL", "R", "XCCL"),
        ("FB", None, "FB"),
        ("Left Medio-Lateral Oblique", "L", "MLO"),
        ("cranio-caudal exaggerated medially", None, "XCCM"),
        ("caudo-cranial (from below)", None, "FB"),
    ],
)
def test_spellings(text, side, view):
    found = side_and_view(_header(ViewPosition=text))
    assert (found.side, found.view) == (side, view)
    assert found.refused == found.flags == ()


@pytest.mark.parametrize(
    ("srt", "sct", "view"),
    [
        ("R-10242", "399162004", "CC"),
        ("R-10226", "399368009", "MLO"),
        ("R-10224", "399260004", "ML"),
        ("R-10228", "399352003", "LM"),
        ("R-10230", "399099002", "LMO"),
        ("R-1024A", "399192008", "XCCL"),
        ("R-1024B", "399101009", "XCCM"),
        ("R-10244", "399196006", "FB"),
        ("Y-X1770", "399192008", "XCCL"),
    ],
)
def test_codes_old_and_new(srt, sct, view):
    assert side_and_view(_coded(srt)).view == view
    assert side_and_view(_coded(srt, scheme="SNM3")).view == view
    assert side_and_view(_coded(sct, scheme="SCT")).view == view


def test_an_unknown_code_is_read_by_its_meaning():
    found = side_and_view(_header(ViewCodeSequence=[_item("V1", "99VENDOR", "medio-lateral oblique")]))
    assert found.view == "MLO"


@pytest.mark.parametrize(
    ("srt", "sct", "words"),
    [
        ("R-102D5", "399209000", "implant displaced"),
        ("R-102D6", "399163009", "magnification"),
        ("R-102D7", "399055006", "spot compression"),
        ("R-102D2", "399161006", "cleavage"),
        ("R-102D1", "399011000", "axillary tail"),
        ("R-102C2", "399110001", "tangential"),
        ("R-102D3", "399197002", "rolled"),
        ("R-102D4", "399226006", "rolled"),
    ],
)
def test_modifiers_that_cannot_be_registered_are_named(srt, sct, words):
    for found in (side_and_view(_coded("R-10242", srt)), side_and_view(_coded("399162004", sct, scheme="SCT"))):
        assert found.view == "CC"
        (refused,) = found.refused
        assert words in refused


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("MCC", "magnification"),
        ("SPOT CC", "spot compression"),
        ("SMLO", "spot compression"),
        ("CCID", "implant displaced"),
        ("RCCRL", "rolled"),
        ("TAN", "tangential"),
        ("CV", "cleavage"),
        ("AT", "axillary tail"),
    ],
)
def test_names_of_views_that_cannot_be_registered(text, words):
    (refused,) = side_and_view(_header(ViewPosition=text)).refused
    assert words in refused


def test_magnification_by_its_factor():
    (refused,) = side_and_view(_header(EstimatedRadiographicMagnificationFactor="1.8")).refused
    assert "magnification view" in refused
    assert side_and_view(_header(EstimatedRadiographicMagnificationFactor="1.12")).refused == ()


def test_harmless_modifiers_pass_and_doubtful_ones_are_flagged():
    assert side_and_view(_coded("R-10226", "R-40AB3")).flags == ()
    (flag,) = side_and_view(_coded("R-10226", "P2-00161")).flags
    assert "anterior compression" in flag


def test_implants_and_partial_views_are_flagged():
    assert side_and_view(_header(BreastImplantPresent="YES", PartialView="YES")).flags == (IMPLANT, PARTIAL)
    assert side_and_view(_header(BreastImplantPresent="NO", PartialView="NO")).flags == ()


def test_a_view_in_patient_orientation_is_read_and_directions_are_left_alone():
    found = side_and_view(_header(PatientOrientation="CC"))
    assert (found.side, found.view) == (None, "CC")
    assert side_and_view(_header(PatientOrientation=["P", "L"])).sides == ()
    assert side_and_view(_header(PatientOrientation=["A", "FR"])).views == ()


def test_elements_that_contradict_each_other_agree_on_nothing():
    header = _coded("R-10226")
    header.ViewPosition = "CC"
    found = side_and_view(header)
    assert found.view is None
    assert [(one.element, one.value) for one in found.views] == [("ViewPosition", "CC"), ("ViewCodeSequence", "MLO")]


def test_a_stale_laterality_of_the_series_does_not_speak_against_the_image():
    assert side_and_view(_header(ImageLaterality="RIGHT", Laterality="L")).side == "R"
    assert side_and_view(_header(Laterality="L")).side == "L"


def test_what_is_not_understood_is_said():
    (flag,) = side_and_view(_header(ViewPosition="ANONYMIZED")).flags
    assert "ViewPosition is not understood" in flag


def test_no_word_of_plain_text_is_taken_for_a_view():
    assert not read_words(["Anonymized", "", "unknown", "SECRET^NAME"]).known
