"""MR volumes as folders of DICOM slices: what exports leave out, add and mix."""

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.random import Generator
from pydicom.uid import generate_uid

from tests.mutants.case_folder import CaseFolder, Effect, edit_dicom
from tests.mutants.mutations.registry import Mutations

SERIES = Mutations("MR folder", ("dicom",))


def _uid(random: Generator) -> str:
    return generate_uid(entropy_srcs=[str(random.integers(1 << 40))])


def _drawn(case: CaseFolder, random: Generator) -> Path:
    slices = case.slices()
    return slices[int(random.integers(len(slices) // 4, 3 * len(slices) // 4))]


def lost(case: CaseFolder, random: Generator, which: Callable[[list[Path], Generator], list[Path]]) -> Effect:
    gone = which(case.slices(), random)
    for path in gone:
        path.unlink()
    return Effect(note=f"{len(gone)} slices lost")


def one_of_the_middle(slices: list[Path], random: Generator) -> list[Path]:
    return [slices[int(random.integers(5, len(slices) - 5))]]


def every_second(slices: list[Path], random: Generator) -> list[Path]:
    return slices[1::2]


def one_half(slices: list[Path], random: Generator) -> list[Path]:
    return slices[len(slices) // 2 :]


def all_but_one(slices: list[Path], random: Generator) -> list[Path]:
    return slices[1:]


def a_few(slices: list[Path], random: Generator) -> list[Path]:
    return list(np.array(slices)[random.choice(len(slices), 6, replace=False)])


def one_changed(case: CaseFolder, random: Generator, change: Callable[[Any], None]) -> Effect:
    edit_dicom(_drawn(case, random), change)
    return Effect(note="one slice")


def all_changed(case: CaseFolder, random: Generator, change: Callable[[Any], None]) -> Effect:
    for path in case.slices():
        edit_dicom(path, change)
    return Effect(note="all slices")


def without(tag: str) -> Callable[[Any], None]:
    def change(dataset: Any) -> None:
        del dataset[tag]

    return change


def setting(**values: Any) -> Callable[[Any], None]:
    def change(dataset: Any) -> None:
        for tag, value in values.items():
            setattr(dataset, tag, value)

    return change


def times(tag: str, *factors: float) -> Callable[[Any], None]:
    def change(dataset: Any) -> None:
        old = dataset[tag].value
        new = [f"{float(x) * f:.5g}" for x, f in zip(np.atleast_1d(old), factors, strict=True)]
        setattr(dataset, tag, new if len(new) > 1 else new[0])

    return change


def blank(dataset: Any) -> None:
    dataset.PixelData = bytes(len(dataset.PixelData))


def swapped(case: CaseFolder, random: Generator) -> Effect:
    """The positions of two slices exchanged."""
    one, other = _drawn(case, random), _drawn(case, random)
    places = [pydicom.dcmread(path).ImagePositionPatient for path in (one, other)]
    if one == other or places[0] == places[1]:
        other = case.slices()[0]
        places[1] = pydicom.dcmread(other).ImagePositionPatient
    edit_dicom(one, setting(ImagePositionPatient=places[1]))
    edit_dicom(other, setting(ImagePositionPatient=places[0]))
    return Effect(note="two positions exchanged")


def upside_down(case: CaseFolder, random: Generator) -> Effect:
    """The positions of the slices in reverse: the feet's end at the head."""
    slices = case.slices()
    places = [pydicom.dcmread(path).ImagePositionPatient for path in slices]
    for path, place in zip(slices, places[::-1], strict=True):
        edit_dicom(path, setting(ImagePositionPatient=place))
    return Effect(note="order of slices reversed")


def copies(case: CaseFolder, random: Generator, count: int, change: Callable[[Any], None], uid: bool) -> Effect:
    """Further slices, copies of some with a change; uid: as instances of their own."""
    slices = case.slices()
    for number, path in enumerate(slices[:: max(1, len(slices) // count)][:count]):
        new = path.with_name(f"extra{number:03d}.dcm")
        shutil.copy(path, new)

        def made(dataset: Any) -> None:
            if uid:
                dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = _uid(random)
            change(dataset)

        edit_dicom(new, made)
    return Effect(note=f"{count} further slices")


def second_series(case: CaseFolder, random: Generator, factor: float) -> Effect:
    """Another series of the same patient among the files, its grey values other ones."""
    series = _uid(random)
    for path in case.slices():
        new = path.with_name(f"second{path.name}")
        shutil.copy(path, new)

        def change(dataset: Any) -> None:
            dataset.SeriesInstanceUID, dataset.SeriesNumber = series, "2"
            dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = _uid(random)
            dataset.PixelData = (dataset.pixel_array * factor).astype("<u2").tobytes()

        edit_dicom(new, change)
    return Effect(note="a second series")


def later_phase(case: CaseFolder, random: Generator) -> Effect:
    """A second phase under the same series and positions."""
    for path in case.slices():
        new = path.with_name(f"phase{path.name}")
        shutil.copy(path, new)

        def change(dataset: Any) -> None:
            dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = _uid(random)
            dataset.TemporalPositionIdentifier, dataset.AcquisitionNumber = "2", "2"
            dataset.PixelData = (dataset.pixel_array * 0.8).astype("<u2").tobytes()

        edit_dicom(new, change)
    return Effect(note="two phases")


def beside(case: CaseFolder, random: Generator, name: str, content: bytes) -> Effect:
    """Another file in the folder."""
    (case.path("mr") / name).write_bytes(content)
    return Effect(note=name)


def report(case: CaseFolder, random: Generator) -> Effect:
    """A structured report beside the slices."""
    new = case.path("mr") / "report.dcm"
    shutil.copy(case.slices()[0], new)

    def change(dataset: Any) -> None:
        dataset.Modality, dataset.SOPClassUID = "SR", "1.2.840.10008.5.1.4.1.1.88.22"
        dataset.file_meta.MediaStorageSOPClassUID = dataset.SOPClassUID
        dataset.SeriesInstanceUID = _uid(random)
        for tag in ("PixelData", "Rows", "Columns", "ImagePositionPatient", "ImageOrientationPatient"):
            del dataset[tag]

    edit_dicom(new, change)
    return Effect(note="a report")


def dangling(case: CaseFolder, random: Generator) -> Effect:
    (case.path("mr") / "lost.dcm").symlink_to("nowhere.dcm")
    return Effect(note="a dangling link")


def other_side(case: CaseFolder, random: Generator) -> Effect:
    from tests.mutants.mutations.mr_nifti import other_side as told

    return told(case, random)


for _which in (one_of_the_middle, every_second, one_half, all_but_one, a_few):
    SERIES.add(f"lost: {_which.__name__.replace('_', ' ')}", partial(lost, which=_which))
for _tag in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "PixelData", "Rows", "Modality"):
    SERIES.add(f"one slice without {_tag}", partial(one_changed, change=without(_tag)))
for _tag in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SeriesInstanceUID", "BitsStored"):
    SERIES.add(f"all slices without {_tag}", partial(all_changed, change=without(_tag)))
for _name, _change in {
    "spacing times 10": times("PixelSpacing", 10.0, 10.0),
    "spacing times 0.1": times("PixelSpacing", 0.1, 0.1),
    "spacing times 1.5": times("PixelSpacing", 1.5, 1.5),
    "positions times 10": times("ImagePositionPatient", 1.0, 1.0, 10.0),
    "positions times 0.1": times("ImagePositionPatient", 1.0, 1.0, 0.1),
    "columns the other way": setting(ImageOrientationPatient=["1", "0", "0", "0", "-1", "0"]),
    "rows the other way": setting(ImageOrientationPatient=["-1", "0", "0", "0", "1", "0"]),
    "sagittal orientation": setting(ImageOrientationPatient=["0", "1", "0", "0", "0", "-1"]),
    "orientation of zeros": setting(ImageOrientationPatient=["0"] * 6),
    "orientation of two numbers": setting(ImageOrientationPatient=["1", "0"]),
    "modality CT": setting(Modality="CT"),
    "BitsStored 8": setting(BitsStored=8, HighBit=7),
    "signed": setting(PixelRepresentation=1),
    "subtraction by its name": setting(ImageType=["DERIVED", "SECONDARY", "SUBTRACTION"], SeriesDescription="SUB"),
    "projection by its name": setting(ImageType=["DERIVED", "SECONDARY", "PROJECTION IMAGE", "MIP"]),
    "negative rescale": setting(RescaleSlope="-1", RescaleIntercept="0"),
}.items():
    SERIES.add(f"all: {_name}", partial(all_changed, change=_change))
for _name, _change in {
    "spacing other": times("PixelSpacing", 1.5, 1.5),
    "position far": setting(ImagePositionPatient=["0", "0", "900"]),
    "position no number": setting(ImagePositionPatient=None),
    "other orientation": setting(ImageOrientationPatient=["0", "1", "0", "0", "0", "-1"]),
    "blank": blank,
    "series of its own": setting(SeriesInstanceUID="1.2.3.4"),
    "rescale of its own": setting(RescaleSlope="40", RescaleIntercept="0"),
    "of another patient": setting(PatientID="OTHER", StudyInstanceUID="1.2.3.5"),
    "size other": setting(Rows=20),
}.items():
    SERIES.add(f"one slice: {_name}", partial(one_changed, change=_change))
SERIES.add("positions exchanged", swapped, times=2)
SERIES.add("slices upside down", upside_down)
SERIES.add("copies of some slices", partial(copies, count=5, change=lambda d: None, uid=False))
SERIES.add("doubled slices", partial(copies, count=8, change=lambda d: None, uid=True))
SERIES.add("two echoes half a slice apart", partial(copies, count=1000, change=lambda d: _half_a_slice(d), uid=True))
SERIES.add("a second series, brighter", partial(second_series, factor=1.3))
SERIES.add("two phases", later_phase)
SERIES.add("the other side in the table", other_side)
SERIES.add("a damaged file beside", partial(beside, name="damaged.dcm", content=bytes(132) + b"DICM\x00\x01"))
SERIES.add("a dangling link", dangling)


def _half_a_slice(dataset: Any) -> None:
    place = [float(x) for x in dataset.ImagePositionPatient]
    dataset.ImagePositionPatient = [*place[:2], f"{place[2] + 0.5 * float(dataset.SliceThickness):.3f}"]
    dataset.EchoNumbers = "2"


SERIES.add("a report beside", report, harmless=True)
SERIES.add("a text beside", partial(beside, name="readme.txt", content=b"exported by the viewer\n"), harmless=True)
MUTATIONS = SERIES.found
