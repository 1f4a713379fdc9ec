"""Plain and synthetic mammograms pass; parts of a tomosynthesis and other images are named."""

import pytest
from pydicom.dataelem import RawDataElement
from pydicom.dataset import Dataset
from pydicom.tag import Tag

from stages.cohort.readers.header_values import texts
from stages.cohort.readers.mammogram.kind import lift_frame_values, other_kind

TOMOSYNTHESIS = "1.2.840.10008.5.1.4.1.1.13.1.3"
PROJECTION = "1.2.840.10008.5.1.4.1.1.13.1.4"
MAMMOGRAM = "1.2.840.10008.5.1.4.1.1.1.2"


def _header(**elements):
    header = Dataset()
    for keyword, value in ({"Modality": "MG", "SOPClassUID": MAMMOGRAM} | elements).items():
        setattr(header, keyword, value)
    return header


@pytest.mark.parametrize(
    "elements",
    [
        {},
        {"ImageType": ["ORIGINAL", "PRIMARY"], "NumberOfFrames": 1},
        {"ImageType": ["DERIVED", "PRIMARY", "", "LOW_ENERGY"]},
        {"ImageType": ["DERIVED", "PRIMARY", "TOMOSYNTHESIS", "GENERATED_2D"], "SOPClassUID": TOMOSYNTHESIS},
        {"ImageType": ["DERIVED", "PRIMARY", "TOMO_2D", "RIGHT"]},
        {"SeriesDescription": "R CC C-View", "ImageType": ["DERIVED", "PRIMARY", "TOMO", "RIGHT"]},
        {"SeriesDescription": "R CC Tomo HD"},
        {"Modality": "CR", "BodyPartExamined": "BREAST"},
    ],
)
def test_a_plain_or_synthetic_mammogram_passes(elements):
    assert other_kind(_header(**elements)) is None


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ({"SOPClassUID": TOMOSYNTHESIS, "ImageType": ["DERIVED", "PRIMARY", "TOMOSYNTHESIS", "NONE"]}, "a slice"),
        ({"SOPClassUID": TOMOSYNTHESIS}, "a slice"),
        ({"ImageType": ["DERIVED", "PRIMARY", "TOMOSYNTHESIS", "NONE"], "NumberOfFrames": 1}, "a slice"),
        ({"SOPClassUID": TOMOSYNTHESIS, "NumberOfFrames": 60}, "several frames"),
        ({"NumberOfFrames": 2, "ImageType": ["DERIVED", "PRIMARY", "TOMO", "GENERATED_2D"]}, "several frames"),
        ({"SOPClassUID": PROJECTION}, "a projection"),
        ({"ImageType": ["ORIGINAL", "PRIMARY", "TOMO_PROJ", "RIGHT"]}, "a projection"),
        ({"SeriesDescription": "R MLO Tomosynthesis Reconstruction"}, "a slice"),
        ({"VolumetricProperties": "VOLUME"}, "a slice"),
        ({"ImageType": ["DERIVED", "PRIMARY", "", "RECOMBINED"]}, "low-energy image"),
        ({"ImageType": ["ORIGINAL", "PRIMARY", "STEREO_PLUS"]}, "stereotactic"),
        ({"QualityControlImage": "YES"}, "quality control"),
        ({"Modality": "CR", "BodyPartExamined": "CHEST"}, "modality is CR, not MG"),
    ],
)
def test_what_is_no_plain_mammogram_is_named(elements, words):
    assert words in other_kind(_header(**elements))


def test_values_of_the_frame_stand_in_for_missing_ones_and_overwrite_none():
    measures, anatomy, group = Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, anatomy.FrameLaterality = [0.1, 0.1], "R"
    group.PixelMeasuresSequence, group.FrameAnatomySequence = [measures], [anatomy]
    taken = Dataset()
    taken.BodyPartThickness, taken.PositionerPrimaryAngle = 61, 45
    header = _header(SharedFunctionalGroupsSequence=[group], XRay3DAcquisitionSequence=[taken], BodyPartThickness=60)
    lift_frame_values(header)
    assert (header.PixelSpacing, header.FrameLaterality, header.PositionerPrimaryAngle) == ([0.1, 0.1], "R", 45)
    assert header.BodyPartThickness == 60


def test_a_value_of_the_frame_that_is_no_number_is_lifted_as_it_is():
    taken = Dataset()
    tag = Tag("BodyPartThickness")
    taken[tag] = RawDataElement(tag, "DS", 10, b"Anonymized", 0, False, True)
    header = _header(XRay3DAcquisitionSequence=[taken])
    lift_frame_values(header)
    assert texts(header, "BodyPartThickness") == ("Anonymized",)
