"""Changes after which the files say what they said: a sound answer must stand, and nothing may be said against it."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator
from PIL import Image
from pydicom.uid import DeflatedExplicitVRLittleEndian, ImplicitVRLittleEndian, RLELossless, generate_uid

from tests.mutants.case_folder import (
    CaseFolder,
    Effect,
    edit_dicom,
    read_picture,
    write_picture,
)
from tests.mutants.mutations.mammogram_headers import edited
from tests.mutants.mutations.mammogram_pictures import drawn, moved, turned
from tests.mutants.mutations.marks import cells, text
from tests.mutants.mutations.registry import Mutations
from tests.mutants.mutations.tables import as_text

HARMLESS = Mutations("harmless", ("nifti",))


def syntax(case: CaseFolder, random: Generator, uid: Any, implicit: bool = False) -> Effect:
    """Another transfer syntax of the mammograms."""
    import pydicom

    for view in case.views:
        path = case.path("image", view, ".dcm")
        dataset = pydicom.dcmread(path)
        if uid == RLELossless:
            dataset.compress(RLELossless)
        else:
            dataset.file_meta.TransferSyntaxUID = uid
        dataset.save_as(path, implicit_vr=implicit, little_endian=True)
    return Effect(note=uid.name)


def private_tags(case: CaseFolder, random: Generator) -> Effect:
    def change(dataset: Any) -> None:
        block = dataset.private_block(0x0011, "EXAMPLE 1.0", create=True)
        block.add_new(0x01, "LO", "anything")
        block.add_new(0x02, "UN", bytes(range(64)))

    return edited(case, random, change, note="private tags")


def other_texts(case: CaseFolder, random: Generator) -> Effect:
    """Names, descriptions and identifiers that mean nothing to us."""

    def change(dataset: Any) -> None:
        dataset.SpecificCharacterSet, dataset.PatientName = "ISO_IR 192", "Müller^Zoë"
        dataset.StudyDescription, dataset.InstitutionName = "Mammographie beidseits", "Klinik"
        dataset.SeriesInstanceUID = generate_uid(entropy_srcs=["other"])

    return edited(case, random, change, note="other texts")


def inverted_with_header(case: CaseFolder, random: Generator) -> Effect:
    view = drawn(case, random)
    path = case.path("image", view, ".dcm")
    write_picture(path, 4095 - read_picture(path))
    edit_dicom(path, lambda d: setattr(d, "PhotometricInterpretation", "MONOCHROME1"))
    return Effect(note=f"{view} inverted, and says so")


def padded_picture(case: CaseFolder, random: Generator, rows: int) -> Effect:
    """Further rows of air at both ends, marks moved along."""
    view = drawn(case, random)
    to = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, rows]])
    moved(case, view, lambda p: np.pad(p, ((rows, rows), (0, 0)), mode="edge"), to)
    return Effect({view: to}, note=f"{view} padded by {rows} rows")


def little_noise(case: CaseFolder, random: Generator) -> Effect:
    view = drawn(case, random)
    path = case.path("image", view)
    old = read_picture(path).astype(np.int64)
    write_picture(path, np.clip(old + random.integers(-1, 2, old.shape), 0, 4095).astype(np.uint16))
    return Effect(note=f"{view}, one grey value of noise")


def picture_as(case: CaseFolder, random: Generator, mode: str) -> Effect:
    """A picture with more channels, or in another format."""
    view = drawn(case, random)
    path = case.path("image", view, ".png")
    pixels = read_picture(path)
    if mode == "tif":
        Image.fromarray(pixels).save(case.rename("image", view, f"{view.lower()}.tif"))
        return Effect(note=f"{view} as TIFF")
    low, high = float(pixels.min()), float(pixels.max())
    Image.fromarray(np.round(255.0 * (pixels - low) / (high - low)).astype(np.uint8)).convert(mode).save(path)
    return Effect(note=f"{view} as {mode}")


def mask_as(case: CaseFolder, random: Generator, mode: str) -> Effect:
    view = drawn(case, random)
    path = case.path("lesion", view, ".png")
    with Image.open(path) as picture:
        inside = np.asarray(picture) > 0
    values = {"1": inside, "one": inside.astype(np.uint8), "RGB": np.repeat(255 * inside[..., None], 3, -1)}[mode]
    Image.fromarray(values if mode == "1" else values.astype(np.uint8)).save(path)
    return Effect(note=f"mask of {view} as {mode}")


def renamed(case: CaseFolder, random: Generator, column: str, view: str | None, name: str) -> Effect:
    content = case.path(column, view).read_bytes()
    case.rename(column, view, name).write_bytes(content)
    return Effect(note=f"{column} is {name}")


def shuffled_slices(case: CaseFolder, random: Generator, pattern: str) -> Effect:
    """Slices under other names, in another order, perhaps in folders of their own."""
    slices, folder = case.slices(), case.path("mr")
    aside = folder.with_name("aside")
    for number, path in zip(random.permutation(len(slices)), slices, strict=True):
        new = aside / pattern.format(number)
        new.parent.mkdir(parents=True, exist_ok=True)
        path.rename(new)
    folder.rmdir()
    aside.rename(folder)
    return Effect(note=pattern)


def slices_changed(case: CaseFolder, random: Generator, change: Callable[[Any], None]) -> Effect:
    for path in case.slices():
        edit_dicom(path, change)
    return Effect()


def absolute(case: CaseFolder, random: Generator) -> Effect:
    case.case["mr"] = str(case.folder / case.case["mr"])
    return Effect(note="absolute path")


def columns_reversed(lines: list[list[str]]) -> list[list[str]]:
    return [[line[0], *line[:0:-1]] for line in lines]


for _uid, _is in ((ImplicitVRLittleEndian, True), (DeflatedExplicitVRLittleEndian, False), (RLELossless, False)):
    HARMLESS.add(f"mammograms in {_uid.name}", partial(syntax, uid=_uid, implicit=_is), harmless=True)
for _change in (private_tags, other_texts, inverted_with_header, little_noise):
    HARMLESS.add(_change.__name__.replace("_", " "), _change, harmless=True)
HARMLESS.add("little noise", little_noise, bases=("pictures",), harmless=True)
for _rows in (20, 60):
    HARMLESS.add(
        f"{_rows} rows of air more", partial(padded_picture, rows=_rows), bases=("nifti", "pictures"), harmless=True
    )
for _name in ("half a turn", "mirrored", "upside down"):
    HARMLESS.add(
        f"{_name}, as header or table say",
        partial(turned, name=_name, told=True),
        bases=("nifti", "pictures"),
        harmless=True,
    )
for _mode in ("RGB", "LA", "tif"):
    HARMLESS.add(f"picture as {_mode}", partial(picture_as, mode=_mode), bases=("pictures",), harmless=True)
for _mode in ("1", "one", "RGB"):
    HARMLESS.add(f"mask as {_mode}", partial(mask_as, mode=_mode), harmless=True)
HARMLESS.add("mr with spaces", partial(renamed, column="mr", view=None, name="my mr.nii.gz"), harmless=True)
HARMLESS.add("mr in a folder", partial(renamed, column="mr", view=None, name="a/b/mr.v2.nii.gz"), harmless=True)
HARMLESS.add("mammogram without an ending", partial(renamed, column="image", view="CC", name="IM0001"), harmless=True)
HARMLESS.add("mammogram in capitals", partial(renamed, column="image", view="CC", name="CC.DCM"), harmless=True)
HARMLESS.add("accents", partial(renamed, column="image", view="CC", name="vue-côté.dcm"), harmless=True)
for _pattern in ("IM{:05d}", "{:d}.dcm", "sub/{:04d}.IMA"):
    HARMLESS.add(f"slices as {_pattern}", partial(shuffled_slices, pattern=_pattern), bases=("dicom",), harmless=True)
for _name, _change in {
    "without InstanceNumber": lambda d: d.__delitem__("InstanceNumber"),
    "without SliceThickness": lambda d: d.__delitem__("SliceThickness"),
    "private tags": lambda d: d.private_block(0x11, "EXAMPLE", create=True).add_new(1, "LO", "x"),
    "rescale 1, 0": lambda d: (setattr(d, "RescaleSlope", "1"), setattr(d, "RescaleIntercept", "0")),
    "other descriptions": lambda d: setattr(d, "SeriesDescription", "t1_fl3d_tra"),
}.items():
    HARMLESS.add(f"slices: {_name}", partial(slices_changed, change=_change), bases=("dicom",), harmless=True)
HARMLESS.add("absolute path", absolute, harmless=True)
_REAL = ("twin", "victre")
HARMLESS.add("real: private tags", private_tags, bases=_REAL, harmless=True)
HARMLESS.add("real: other texts", other_texts, bases=_REAL, harmless=True)
for _table in (0, 1):
    for _name, _text in {
        "CRLF": lambda t: t.replace("\n", "\r\n"),
        "blank lines": lambda t: t.replace("\n", "\n\n"),
        "no last line end": lambda t: t.rstrip("\n"),
        "spaces in cells": lambda t: t.replace("\t", " \t "),
        "trailing tabs": lambda t: t.replace("\n", "\t\n"),
        "quoted cells": lambda t: t.replace("case1", '"case1"'),
    }.items():
        HARMLESS.add(f"table {_table + 1}: {_name}", partial(as_text, change=_text, table=_table), harmless=True)
    HARMLESS.add(
        f"table {_table + 1}: byte order mark",
        partial(as_text, change=str, table=_table, encoding="utf-8-sig"),
        harmless=True,
    )
for _column, _view in (("mr_lesion", None), ("lesion", "CC")):
    for _name, _text in {
        "CRLF": lambda t: t.replace("\n", "\r\n"),
        "more digits": lambda t: t.replace("0\n", "0000\n"),
        "blank line at the end": lambda t: t + "\n",
    }.items():
        HARMLESS.add(
            f"{_column}: {_name}",
            partial(text, column=_column, change=_text, view=_view),
            bases=("pictures",),
            harmless=True,
        )
    HARMLESS.add(
        f"{_column}: columns in another order",
        partial(cells, column=_column, change=columns_reversed, view=_view),
        bases=("pictures",),
        harmless=True,
    )
MUTATIONS = HARMLESS.found
