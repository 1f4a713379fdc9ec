"""A mammogram's file with what is needed of it and nothing that says whose it is."""

import io

from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import generate_uid

from stages.cohort.readers.mammogram.kind import other_kind

_GROUPS = (0x0018, 0x0028, 0x0054, 0x2050, 0x5200, 0x7FE0)
"""Acquisition, pixels, views, presentation, functional groups, samples."""
_KEPT = frozenset(
    {
        *("SpecificCharacterSet", "ImageType", "SOPClassUID", "Modality", "PresentationIntentType", "Manufacturer"),
        *("ManufacturerModelName", "AnatomicRegionSequence", "AnatomicRegionModifierSequence", "CodeValue"),
        *("CodingSchemeDesignator", "CodeMeaning", "PatientOrientation", "Laterality", "ImageLaterality"),
        *("FrameLaterality", "FrameAnatomySequence", "VolumetricProperties", "PaddleDescription", "ViewName"),
    }
)
_VALUES = frozenset({"CS", "DS", "IS", "US", "SS", "UL", "SL", "FL", "FD", "AT", "SQ", "OB", "OW"})
"""Kinds of values that hold no text of a person's; of the others only what `_KEPT` names is kept."""


def deidentified(header: Dataset, patient: str, name: str) -> bytes:
    """The file of an image with its pixels, its geometry and how it was taken; no name, number, date or identifier.

    Args:
        header: the whole dataset, pixels included.
        patient: pseudonym that takes the place of name and number.
        name: what its new identifier is made of.
    """
    found = _kept(header)
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = header.file_meta.TransferSyntaxUID
    meta.MediaStorageSOPClassUID = header.SOPClassUID
    meta.MediaStorageSOPInstanceUID = found.SOPInstanceUID = generate_uid(entropy_srcs=["mammoreg import", name])
    found.file_meta = meta
    found.PatientID, found.PatientName, found.PatientIdentityRemoved = patient, patient, "YES"
    if other_kind(header) is None and other_kind(found) is not None:
        # What tells a synthetic mammogram from a slice of its tomosynthesis may be a description alone.
        found.SeriesDescription = "SYNTHETIC"
    buffer = io.BytesIO()
    found.save_as(buffer, enforce_file_format=True)
    return buffer.getvalue()


def _kept(header: Dataset) -> Dataset:
    found = Dataset()
    for tag in header.keys():  # noqa: SIM118  a Dataset iterates over converted elements, which may raise
        if tag.is_private:
            continue
        element = header.get_item(tag)
        keyword, kind = _described(tag, element.VR)
        if keyword not in _KEPT and not (tag.group in _GROUPS and kind in _VALUES):
            continue
        if kind == "SQ":
            setattr(found, keyword, [_kept(item) for item in header[tag].value])
        else:
            found[tag] = element
    return found


def _described(tag: int, kind: str | None) -> tuple[str, str]:
    from pydicom.datadict import dictionary_VR, keyword_for_tag

    try:
        return keyword_for_tag(tag), (kind or dictionary_VR(tag)).split(" ")[0]
    except KeyError:
        return "", ""
