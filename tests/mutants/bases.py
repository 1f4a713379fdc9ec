"""The unmutated cases, in every form in which users hand them in, written as files with their two tables."""

import csv
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from mammoreg.geometry import breast_to_plate, plate_to_breast
from mammoreg.phantom import anatomy, mammogram, warp
from mammoreg.phantom import patient as patients
from mammoreg.phantom.compression import Pressed
from mammoreg.phantom.patient import Patient
from mammoreg.phantom.warp import Deformed
from stages.digital import stage as digital
from stages.digital.stage import DigitalPatient, Settings
from stages.engine.contract import Inputs, Subject
from tests.mutants.case_folder import NAME, CaseFolder, edit_dicom, nifti_of, read_picture, write_table
from tests.shared_data import DATA

_GRIDS = {
    (digital, "MR_MM"): (2.0, 3.0),
    (digital, "PIXEL_MM"): (0.4, 0.8),
    (digital, "ROWS"): (650, 325),
    (digital, "COLUMNS"): (450, 225),
    (mammogram, "SPACING_MM"): (2.0, 3.0),
    (warp, "MAP_SPACING_MM"): (4.0, 6.0),
    (anatomy, "TISSUE_SPACING_MM"): (2.0, 2.5),
}
"""Grids of the digital patients at reduced size, and of those that are made in seconds."""


@contextmanager
def coarse(quick: bool) -> Iterator[None]:
    """Digital patients at reduced size; quick: smaller, and squeezed by a linear map instead of the elements' press."""
    with pytest.MonkeyPatch.context() as patch:
        for (module, name), values in _GRIDS.items():
            patch.setattr(module, name, values[quick])
        if quick:
            patch.setattr(Patient, "pressed", _squeezed)
        else:
            patch.setattr(patients, "MESH", {"core": 6, "rows": 7, "shells": 2})
            patch.setattr(Patient, "pressed", _pressed_once)
        yield


_pressed, _kept = Patient.pressed, dict[tuple[int, str], tuple[Pressed, Deformed]]()


def _pressed_once(patient: Patient, view: Any) -> tuple[Pressed, Deformed]:
    """The same for every form in which a patient's files are written."""
    if (patient.seed, view) not in _kept:
        _kept[patient.seed, view] = _pressed(patient, view)
    return _kept[patient.seed, view]


def _squeezed(patient: Patient, view: Any) -> tuple[Pressed, Deformed]:
    placement = patient.placements[view]
    plate = breast_to_plate(patient.mesh.points, placement.angle_deg) * [1.2, 1.0, 0.5]
    shown = plate[plate[:, 1] < placement.edge_p_mm, 2]
    gap = float(np.ptp(shown))
    pressed = Pressed(plate, float(shown.min()), gap, gap / 0.5, 80.0, 0.8, 0.0, 0.05, 1)
    return pressed, Deformed(patient.anatomy, patient.mesh, plate_to_breast(plate, placement.angle_deg))


_PATIENTS = {
    "single": DigitalPatient(seed=20276),
    "both": DigitalPatient(seed=20271, both_breasts=True, fat_suppressed=True, monochrome1=True),
}
_SIDES: Mapping[str, Any] = {"single": "L", "both": "R"}


@cache
def _files(patient: str, form: str, quick: bool) -> dict[str, bytes]:
    chosen = _PATIENTS[patient].model_copy(update={"mr_form": form})
    with coarse(quick):
        return dict(digital.run(Inputs(), Settings(patients={NAME: chosen}), Subject(NAME, _SIDES[patient])).files)


def _write_digital(folder: Path, patient: str = "single", form: str = "nifti", quick: bool = False) -> CaseFolder:
    for name, content in _files(patient, form, quick).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    mr = "mr" if form == "dicom" else "mr.nii.gz"
    files = {"mr": mr, "mr_lesion": "mr_lesion.nii.gz", "mr_landmarks": "mr_landmarks.tsv"}
    views = {
        view: {"case": NAME, "view": view, "image": f"{view.lower()}.dcm", "lesion": f"{view.lower()}_lesion.png"}
        for view in ("CC", "MLO")
    }
    case = CaseFolder(folder, {"case": NAME, "laterality": _SIDES[patient], **files}, views)
    case.write_tables()
    return case


def _write_pictures(folder: Path, quick: bool = False) -> CaseFolder:
    """Mammograms as PNG, what their headers say in the table, and the marks as tables."""
    case = _write_digital(folder, quick=quick)
    for view, row in case.views.items():
        _as_picture(case, view, row)
    _marks_as_tables(case)
    case.write_tables()
    return case


def _as_picture(case: CaseFolder, view: str, row: dict[str, str]) -> None:
    facts: dict[str, str] = {}

    def note(header: Any) -> None:
        facts["spacing"] = str(header.ImagerPixelSpacing[0])
        facts["thickness_mm"] = str(header.BodyPartThickness)
        facts["force_n"] = str(header.CompressionForce)
        facts["angle_deg"] = str(header.PositionerPrimaryAngle)
        facts["source_detector_mm"] = str(header.DistanceSourceToDetector)
        facts["orientation"] = "\\".join(header.PatientOrientation)

    path = case.path("image", view)
    pixels = read_picture(path)
    edit_dicom(path, note)
    Image.fromarray(pixels).save(case.rename("image", view, f"{view.lower()}.png"))
    row |= {"pixel_spacing_mm": facts.pop("spacing"), **facts}


def _marks_as_tables(case: CaseFolder) -> None:
    """Centres and diameters of the masks, as a reader would write them down."""
    _, image, mask = nifti_of(case, "mr_lesion")
    x, y, z, _ = image.affine @ [*ndimage.center_of_mass(mask), 1.0]
    diameter = 2.0 * (3.0 * mask.sum() * abs(np.linalg.det(image.affine[:3, :3])) / (4.0 * np.pi)) ** (1 / 3)
    line = ["lesion", f"{-x:.2f}", f"{-y:.2f}", f"{z:.2f}", f"{diameter:.1f}"]
    write_table(case.rename("mr_lesion", None, "mr_lesion.tsv"), [["name", "x", "y", "z", "diameter_mm"], line])
    for view, cells in case.views.items():
        inside = read_picture(case.path("lesion", view)) > 0
        row, column = ndimage.center_of_mass(inside)
        diameter = 2.0 * np.sqrt(inside.sum() / np.pi) * float(cells["pixel_spacing_mm"])
        line = ["lesion", f"{column:.1f}", f"{row:.1f}", f"{diameter:.1f}"]
        new = case.rename("lesion", view, f"{view.lower()}_lesion.tsv")
        write_table(new, [["name", "column", "row", "diameter_mm"], line])


def _write_shared(folder: Path, cohort: str, case: str, drop: tuple[str, ...] = ()) -> CaseFolder:
    """A case of a cohort beside the project, its files under short names."""
    source, rows = DATA / cohort, dict[str, list[dict[str, str]]]()
    for table in ("cases", "views"):
        with (source / f"{table}.tsv").open(encoding="utf-8", newline="") as file:
            rows[table] = [r for r in csv.DictReader(file, delimiter="\t") if r["case"] == case]
    folder.mkdir(parents=True, exist_ok=True)
    for row in (*rows["cases"], *rows["views"]):
        for column in [c for c in row if c in drop or not row[c]]:
            del row[column]
        for column, cell in row.items():
            if (source / cell).is_file():
                row[column] = Path(cell).name
                shutil.copy(source / cell, folder / row[column])
        row["case"] = NAME
    found = CaseFolder(folder, rows["cases"][0], {row["view"]: row for row in rows["views"]})
    found.write_tables()
    return found


def _only_cc(case: CaseFolder) -> CaseFolder:
    """Without the other view and the landmarks, whose predictions take time."""
    del case.views["MLO"], case.case["mr_landmarks"]
    case.write_tables()
    return case


BASES: dict[str, Callable[[Path], CaseFolder]] = {
    "nifti": _write_digital,
    "dicom": lambda folder: _write_digital(folder, form="dicom"),
    "pictures": _write_pictures,
    "both": lambda folder: _write_digital(folder, "both"),
    "twin": lambda folder: _write_shared(folder, "twins", "twin1"),
    "victre": lambda folder: _write_shared(folder, "victre", "victre_p1", ("mr_compressed", "mr_compressed_landmarks")),
}
"""By name; `twin` and `victre` lie beside the project."""
QUICK: dict[str, Callable[[Path], CaseFolder]] = {"nifti": lambda folder: _only_cc(_write_digital(folder, quick=True))}
"""One view of a breast that a linear map has squeezed, made in seconds."""
SHARED = {"twin": "twins", "victre": "victre"}


def available() -> list[str]:
    """Names of the bases that can be made here."""
    return [name for name in BASES if name not in SHARED or (DATA / SHARED[name]).exists()]
