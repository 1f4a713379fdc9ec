"""What kind of image a DICOM file of a mammography unit holds: plain mammograms pass, the others are named."""

import re
from collections.abc import Iterator

from pydicom.datadict import dictionary_has_tag, dictionary_VR, keyword_for_tag
from pydicom.dataset import Dataset
from pydicom.uid import (
    BreastProjectionXRayImageStorageForPresentation,
    BreastProjectionXRayImageStorageForProcessing,
    BreastTomosynthesisImageStorage,
    CTImageStorage,
)

from stages.cohort.readers.header_values import items, number, text, texts

_RADIOGRAPHS = ("CR", "DX", "DR", "RG")
"""Modalities that some units and scanners write for a mammogram."""
_BREAST_CODES = ("T-04000", "76752008", "T-04020", "73056007", "T-04030", "80248007")
_SYNTHETIC = re.compile(r"GENERATED_2D|TOMO_?2D|(?<!TOMO)SYNTH|C-?VIEW|S-VIEW|V-PREVIEW|INSIGHT.?2D|INTELLIGENT.?2D")
_TOMOSYNTHESIS = re.compile(r"TOMO.*(RECON|SLICE|SLAB|PROJ)|\bDBT\b")
_OF_TYPE = (
    (re.compile(r"RECOMB|SUBTRACT"), "a recombined contrast image, which shows no density; name the low-energy image"),
    (re.compile(r"HIGH_?ENERGY"), "the high-energy image of a contrast mammogram; name the low-energy image"),
    (re.compile(r"STEREO"), "a stereotactic image of a part of the breast; name a plain mammogram"),
)
_PLAIN = "name the plain mammogram or the synthetic one (C-View, Insight 2D), not a part of a tomosynthesis"
_OF_FRAME = (
    "PixelSpacing",
    "FrameLaterality",
    "PatientOrientation",
    "BodyPartThickness",
    "CompressionForce",
    "PositionerPrimaryAngle",
    "DistanceSourceToDetector",
    "DistanceSourceToPatient",
    "ViewCodeSequence",
)


def other_kind(header: Dataset) -> str | None:
    """What a file holds that is no plain mammogram, with the remedy; None for one."""
    modality = text(header, "Modality") or "missing"
    if modality != "MG" and not (modality in _RADIOGRAPHS and _of_breast(header)):
        return f"modality is {modality}, not MG; name a mammogram"
    if (text(header, "QualityControlImage") or "") in ("YES", "BOTH"):
        return "is a quality control image; name a mammogram"
    kind = "\\".join(texts(header, "ImageType")).upper()
    if found := next((what for pattern, what in _OF_TYPE if pattern.search(kind)), None):
        return f"is {found}"
    return _part_of_tomosynthesis(header, kind)


def _part_of_tomosynthesis(header: Dataset, kind: str) -> str | None:
    frames = next((one.value for t in texts(header, "NumberOfFrames") if (one := number(t)) is not None), 1.0)
    if frames > 1:
        return f"holds several frames ({frames:g}), as a tomosynthesis does; {_PLAIN}"
    sop_class, described = text(header, "SOPClassUID"), text(header, "SeriesDescription") or ""
    if _SYNTHETIC.search(kind) or (_SYNTHETIC.search(described) and "PROJ" not in kind):
        return None
    if sop_class in (BreastProjectionXRayImageStorageForPresentation, BreastProjectionXRayImageStorageForProcessing):
        return f"is a projection of a tomosynthesis; {_PLAIN}"
    slices = (BreastTomosynthesisImageStorage, CTImageStorage)
    volumetric = text(header, "VolumetricProperties") in ("VOLUME", "SAMPLED")
    if sop_class in slices or volumetric or "TOMO" in kind or _TOMOSYNTHESIS.search(described):
        return f"is a slice or a projection of a tomosynthesis; {_PLAIN}"
    return None


def _of_breast(header: Dataset) -> bool:
    if "BREAST" in (text(header, "BodyPartExamined") or ""):
        return True
    codes = [text(region, "CodeValue") for region in items(header, "AnatomicRegionSequence")]
    return any(code in _BREAST_CODES for code in codes)


def lift_frame_values(header: Dataset) -> None:
    """Put what an image of the enhanced kind says of its frame where a plain one says it; nothing is overwritten."""
    for group in _frame_groups(header):
        for keyword in _OF_FRAME:
            if keyword not in header and keyword in group:
                # As stored: a value that is none is told by who reads it.
                header[keyword] = group.get_item(keyword)


def _frame_groups(header: Dataset) -> Iterator[Dataset]:
    yield from items(header, "XRay3DAcquisitionSequence")
    for keyword in ("SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"):
        for group in items(header, keyword)[:1]:
            tags = list(group.keys())  # iterating the group itself would read every value
            for tag in tags:
                if dictionary_has_tag(tag) and dictionary_VR(tag) == "SQ":
                    yield from items(group, keyword_for_tag(tag))
