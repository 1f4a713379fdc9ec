"""Headers of mammograms: tags dropped, altered, or filled as no machine should."""

import struct
from collections.abc import Sequence
from functools import partial
from typing import Any

from numpy.random import Generator
from pydicom.datadict import tag_for_keyword
from pydicom.dataset import Dataset

from tests.mutants.case_folder import CaseFolder, DoesNotApplyError, Effect, edit_dicom
from tests.mutants.mutations.registry import Mutations

HEADERS = Mutations("mammogram header", ("nifti", "both"))


def _view(case: CaseFolder, random: Generator, view: str | None) -> str:
    found = [view] if view in case.views else sorted(case.views)
    return str(found[int(random.integers(len(found)))])


def edited(case: CaseFolder, random: Generator, change: Any, view: str | None = None, note: str = "") -> Effect:
    """Change the header of one view, drawn unless named."""
    name = _view(case, random, view)
    edit_dicom(case.path("image", name, ".dcm"), change)
    return Effect(note=f"{name} {note}".strip())


def drop(case: CaseFolder, random: Generator, tag: str) -> Effect:
    def change(dataset: Any) -> None:
        if tag not in dataset:
            raise DoesNotApplyError(tag)
        del dataset[tag]

    return edited(case, random, change, note=f"without {tag}")


def put(case: CaseFolder, random: Generator, view: str | None = None, **values: Any) -> Effect:
    def change(dataset: Any) -> None:
        for tag, value in values.items():
            setattr(dataset, tag, value)

    note = ", ".join(f"{tag} {value}" for tag, value in values.items())
    return edited(case, random, change, view, note)


def raw_text(case: CaseFolder, random: Generator, tag: str, texts: Sequence[str]) -> Effect:
    """A text where a number belongs, past pydicom's own checks."""
    name, text = _view(case, random, None), texts[int(random.integers(len(texts)))]
    path = case.path("image", name, ".dcm")
    path.write_bytes(with_raw_text(path.read_bytes(), tag, text))
    return Effect(note=f"{name} {tag} {text!r}")


def with_raw_text(content: bytes, tag: str, text: str) -> bytes:
    """A file of explicit little endian with other bytes in an element of its first level."""
    number = tag_for_keyword(tag)
    at = content.find(struct.pack("<HH", number >> 16, number & 0xFFFF), 132) if number else -1
    if at < 0:
        raise DoesNotApplyError(tag)
    (length,) = struct.unpack("<H", content[at + 6 : at + 8])
    value = text.encode("latin-1")
    value += b" " * (len(value) % 2)
    return content[: at + 6] + struct.pack("<H", len(value)) + value + content[at + 8 + length :]


def scaled(case: CaseFolder, random: Generator, tag: str, factor: float, both: bool = False) -> Effect:
    def change(dataset: Any) -> None:
        if tag not in dataset:
            raise DoesNotApplyError(tag)
        old = dataset[tag].value
        new = [float(x) * factor for x in old] if isinstance(old, Sequence) and not isinstance(old, str) else None
        setattr(dataset, tag, [f"{x:.6g}" for x in new] if new else f"{float(old) * factor:.6g}")

    if not both:
        return edited(case, random, change, note=f"{tag} times {factor:g}")
    for name in case.views:
        edit_dicom(case.path("image", name, ".dcm"), change)
    return Effect(note=f"both views, {tag} times {factor:g}")


def other_side(case: CaseFolder, random: Generator) -> Effect:
    return put(case, random, ImageLaterality="R" if case.case["laterality"] == "L" else "L")


def other_view(case: CaseFolder, random: Generator, tag: bool = True) -> Effect:
    """ViewPosition says the other view; or it is absent and the code says it."""
    name = _view(case, random, None)
    other = "MLO" if name == "CC" else "CC"

    def change(dataset: Any) -> None:
        if tag:
            dataset.ViewPosition = other
            return
        del dataset.ViewPosition
        code = Dataset()
        code.CodeValue, code.CodingSchemeDesignator = ("R-10226" if other == "MLO" else "R-10242"), "SRT"
        code.CodeMeaning = "view"
        dataset.ViewCodeSequence = [code]

    return edited(case, random, change, name, f"says {other}")


def orientation(case: CaseFolder, random: Generator, rows: bool, columns: bool) -> Effect:
    opposite = {"A": "P", "P": "A", "R": "L", "L": "R", "F": "H", "H": "F"}

    def change(dataset: Any) -> None:
        first, second = dataset.PatientOrientation
        turned = ["".join(opposite[x] for x in text) for text in (first, second)]
        dataset.PatientOrientation = [turned[0] if rows else first, turned[1] if columns else second]

    return edited(case, random, change, note="PatientOrientation turned")


def modifier(case: CaseFolder, random: Generator, value: str, meaning: str) -> Effect:
    """A view modifier: spot compression, magnification, implant displaced."""

    def change(dataset: Any) -> None:
        code = Dataset()
        code.CodeValue, code.CodingSchemeDesignator, code.CodeMeaning = value, "SRT", meaning
        view = dataset.ViewCodeSequence[0] if "ViewCodeSequence" in dataset else Dataset()
        view.ViewModifierCodeSequence = [code]
        dataset.ViewCodeSequence = [view]

    return edited(case, random, change, note=meaning)


def inverted_interpretation(case: CaseFolder, random: Generator) -> Effect:
    def change(dataset: Any) -> None:
        dark = dataset.PhotometricInterpretation == "MONOCHROME1"
        dataset.PhotometricInterpretation = "MONOCHROME2" if dark else "MONOCHROME1"

    return edited(case, random, change, note="interpretation inverted")


def swapped_sizes(case: CaseFolder, random: Generator) -> Effect:
    def change(dataset: Any) -> None:
        dataset.Rows, dataset.Columns = dataset.Columns, dataset.Rows

    return edited(case, random, change, note="Rows and Columns swapped")


def padding(case: CaseFolder, random: Generator) -> Effect:
    """A padding value that grey values of the breast have."""
    return edited(case, random, lambda d: d.add_new("PixelPaddingValue", "US", 2000), note="padding 2000")


def leading_zero(case: CaseFolder, random: Generator) -> Effect:
    def change(dataset: Any) -> None:
        dataset.BodyPartThickness = f"0{dataset.BodyPartThickness}"

    return edited(case, random, change, note="thickness with a leading zero")


_DROPPED = (
    *("ViewPosition", "ImageLaterality", "PatientOrientation", "ImagerPixelSpacing", "BodyPartThickness"),
    *("PositionerPrimaryAngle", "DistanceSourceToDetector", "DistanceSourceToPatient", "Modality", "Rows"),
    *("EstimatedRadiographicMagnificationFactor", "PhotometricInterpretation", "PresentationIntentType"),
    *("BitsStored", "PixelRepresentation", "CompressionForce", "PixelData", "SOPClassUID", "ViewCodeSequence"),
)
for _tag in _DROPPED:
    HEADERS.add(f"without {_tag}", partial(drop, tag=_tag), bases=("nifti",))
NUMBERS = ("ImagerPixelSpacing", "BodyPartThickness", "PositionerPrimaryAngle", "DistanceSourceToDetector")
NO_NUMBERS = ("0,2", "nan", "Anonymized", "", "1e400", "-", "0", "-5", "5 cm", "7\\8\\9")
for _tag in NUMBERS:
    HEADERS.add(f"{_tag} no number", partial(raw_text, tag=_tag, texts=NO_NUMBERS), bases=("nifti",), times=5)
for _tag, _factors in {
    "ImagerPixelSpacing": (10.0, 0.1, 2.0, 0.5, 1.18, 0.85),
    "BodyPartThickness": (10.0, 0.1, 2.0, 0.5),
    "DistanceSourceToDetector": (10.0, 0.1, 0.001, 2.0),
    "DistanceSourceToPatient": (0.1, 0.001),
    "EstimatedRadiographicMagnificationFactor": (1.8,),
    "CompressionForce": (10.0, 0.1),
}.items():
    for _factor in _factors:
        HEADERS.add(f"{_tag} times {_factor:g}", partial(scaled, tag=_tag, factor=_factor))
for _factor in (10.0, 0.1, 1.18, 0.85):
    HEADERS.add(
        f"ImagerPixelSpacing of both views times {_factor:g}",
        partial(scaled, tag="ImagerPixelSpacing", factor=_factor, both=True),
    )
for _tag, _factor in (("ImagerPixelSpacing", 10.0), ("ImagerPixelSpacing", 1.18), ("BodyPartThickness", 0.1)):
    _real = partial(scaled, tag=_tag, factor=_factor)
    HEADERS.add(f"real: {_tag} times {_factor:g}", _real, bases=("twin", "victre"))
HEADERS.add("other side", other_side, bases=("nifti", "both", "twin", "victre"))
HEADERS.add("ViewPosition of the other view", other_view, bases=("nifti", "both", "twin", "victre"))
HEADERS.add("view code of the other view alone", partial(other_view, tag=False))
HEADERS.add("PatientOrientation of rows reversed", partial(orientation, rows=True, columns=False))
HEADERS.add("PatientOrientation of columns reversed", partial(orientation, rows=False, columns=True))
HEADERS.add("PatientOrientation of both reversed", partial(orientation, rows=True, columns=True))
HEADERS.add("spot compression", partial(modifier, value="R-102D7", meaning="spot compression"), bases=("nifti",))
HEADERS.add("magnification view", partial(modifier, value="R-102D6", meaning="magnification"), bases=("nifti",))
HEADERS.add("implant displaced", partial(modifier, value="R-102D5", meaning="implant displaced"), bases=("nifti",))
HEADERS.add("interpretation inverted", inverted_interpretation)
HEADERS.add("Rows and Columns swapped", swapped_sizes, bases=("nifti",))
for _name, _values in {
    "implant": {"BreastImplantPresent": "YES"},
    "partial view": {"PartialView": "YES"},
    "several frames": {"NumberOfFrames": 40},
    "modality MR": {"Modality": "MR"},
    "modality CR": {"Modality": "CR"},
    "angle 400": {"PositionerPrimaryAngle": "400"},
    "angle in radians": {"PositionerPrimaryAngle": "0.785"},
    "angle of the other view": {"view": "MLO", "PositionerPrimaryAngle": "0"},
    "BitsStored 8": {"BitsStored": 8, "HighBit": 7},
    "signed pixels": {"PixelRepresentation": 1},
    "colour": {"SamplesPerPixel": 3, "PhotometricInterpretation": "RGB"},
    "palette": {"PhotometricInterpretation": "PALETTE COLOR"},
    "character set unknown": {"SpecificCharacterSet": "ISO_IR 999"},
    "specimen": {"BodyPartExamined": "SPECIMEN"},
    "PixelSpacing differs": {"PixelSpacing": [1.0, 1.0]},
    "anisotropic spacing": {"ImagerPixelSpacing": [0.4, 0.2]},
}.items():
    HEADERS.add(_name, partial(put, **_values), bases=("nifti",))
HEADERS.add("padding that is breast", padding, bases=("nifti",))
HEADERS.add("thickness with a leading zero", leading_zero, bases=("nifti",), harmless=True)
HEADERS.add("thickness of another breast", partial(put, BodyPartThickness="52"), bases=("nifti",))
MUTATIONS = HEADERS.found
