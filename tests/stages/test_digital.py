"""Files of the embedded cohort."""

import csv
import gzip
import io
from functools import cache
from pathlib import Path

import nibabel as nib
import numpy as np
import pydicom
import pytest
from PIL import Image

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, Volume, breast_to_plate, plate_to_breast
from mammoreg.phantom import anatomy, mammogram, warp
from mammoreg.phantom.compression import Pressed
from mammoreg.phantom.patient import ROLL_DEG, Patient
from mammoreg.phantom.warp import Deformed
from stages.cohort.readers.mr.volume import read_mr
from stages.digital import stage as digital
from stages.digital.dicom import mammogram_dicom, nifti, points_tsv, stored_mask
from stages.digital.stage import Settings
from stages.engine.contract import Inputs, Subject

TABLES = Path(__file__).resolve().parents[2] / "config" / "digital"
VIEW = ViewGeometry(6.0, 0.0, 5.0, -30.0, 60.0, 650.0, 15.0, 0.2, 8, 6)


def rows(name):
    with (TABLES / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def named_files(case):
    """Files that the tables name for a case."""
    cells = [cell for row in (*rows("cases.tsv"), *rows("views.tsv")) if row["case"] == case for cell in row.values()]
    return {cell.removeprefix(f"{case}/") for cell in cells if "/" in cell}


@pytest.fixture(scope="module")
def quick():
    """Coarse images, and an affine squeeze instead of the finite-element one."""

    def pressed(patient, view):
        placement = patient.placements[view]
        plate = breast_to_plate(patient.mesh.points, placement.angle_deg) * [1.15, 1.0, 0.7]
        gap = float(np.ptp(plate[:, 2]))
        result = Pressed(plate, float(plate[:, 2].min()), gap, gap / 0.7, 50.0, 0.8, 0.0, 0.05, 1)
        return result, Deformed(patient.anatomy, patient.mesh, plate_to_breast(plate, placement.angle_deg))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Patient, "pressed", pressed)
        patch.setattr(warp, "MAP_SPACING_MM", 6.0)
        patch.setattr(mammogram, "SPACING_MM", 3.0)
        patch.setattr(anatomy, "TISSUE_SPACING_MM", 2.5)
        for name, value in {"MR_MM": 5.0, "PIXEL_MM": 1.0, "ROWS": 200, "COLUMNS": 140}.items():
            patch.setattr(digital, name, value)
        yield cache(make)


def make(case, laterality):
    return digital.run(Inputs(), Settings(), Subject(case, laterality))


@pytest.mark.parametrize("row", rows("cases.tsv"), ids=lambda row: row["case"])
def test_a_patients_files_are_those_that_the_tables_name(quick, row):
    fields = quick(row["case"], row["laterality"])
    files = {"mr" if name.startswith("mr/") else name for name in fields.files}
    assert files == named_files(row["case"])
    assert fields.status == "ok"


def test_made_again_the_files_are_the_same(quick):
    assert make("clinical1", "R").files == quick("clinical1", "R").files


def test_landmarks_and_lesion_lie_in_the_volume_where_the_tables_say(quick):
    fields = quick("clinical2", "L")
    image = nib.Nifti1Image.from_bytes(gzip.decompress(fields.files["mr_lesion.nii.gz"]))
    inside = np.argwhere(np.asarray(image.dataobj) > 0).mean(axis=0)
    ras = image.affine @ [*inside, 1.0]
    centre = fields.arrays["lesion_centre"].data[0]
    assert np.linalg.norm(ras[:3] * [-1, -1, 1] - centre) < 3.0
    assert centre[0] > 0.0  # a left breast lies at positive x


def test_a_mask_lies_over_the_lesion_in_the_stored_image(quick):
    fields = quick("clinical1", "R")
    mask = np.array(Image.open(io.BytesIO(fields.files["cc_lesion.png"])))
    truth = fields.values["CC"]
    view = ViewGeometry(
        truth["angle_deg"],
        truth["edge_p_mm"],
        truth["middle_mm"],
        truth["height_mm"],
        truth["thickness_mm"],
        650.0,
        15.0,
        1.0,
        200,
        140,
    )
    column, row = view.project(breast_to_plate(fields.arrays["CC/lesion_centre"].data[0], view.angle_deg))
    found = np.argwhere(mask > 0).mean(axis=0)
    assert np.abs(found - [row, 139 - column]).max() < 3.0


def test_the_header_does_not_tell_the_truth(quick):
    fields = quick("clinical1", "R")
    header = pydicom.dcmread(io.BytesIO(fields.files["mlo.dcm"]), stop_before_pixels=True)
    assert header.PositionerPrimaryAngle == 45
    assert abs(fields.values["MLO"]["angle_deg"] - 45.0) >= ROLL_DEG[0]
    assert abs(float(header.BodyPartThickness) - fields.values["MLO"]["thickness_mm"]) < 2.6
    assert float(header.BodyPartThickness).is_integer()


def test_seeds_follow_each_other_in_the_order_of_the_table():
    patients = Settings().patients
    assert list(patients) == [row["case"] for row in rows("cases.tsv")]
    assert [patient.seed for patient in patients.values()] == list(range(20271, 20278))


def test_an_unknown_case_is_named_with_those_that_exist():
    with pytest.raises(DataError, match=r"no 'nobody'; it has clinical1"):
        make("nobody", "R")


@pytest.mark.parametrize(("laterality", "view", "orientation", "first"), [
    ("R", "CC", ["P", "L"], 5), ("L", "CC", ["A", "R"], 0), ("R", "MLO", ["P", "FL"], 5), ("L", "MLO", ["A", "FR"], 0),
])  # fmt: skip
def test_a_mammogram_is_stored_as_its_orientation_says(laterality, view, orientation, first):
    image = np.zeros((8, 6), dtype=np.uint16)
    image[:, 0] = 4000  # the chest wall
    content = mammogram_dicom(image, Subject("c", laterality), view, VIEW, 58.7, 81.24, False)
    dataset = pydicom.dcmread(io.BytesIO(content))
    assert list(dataset.PatientOrientation) == orientation
    assert (dataset.pixel_array[:, first] == 4000).all()
    assert (dataset.ImageLaterality, dataset.ViewPosition) == (laterality, view)
    assert (dataset.BodyPartThickness, dataset.CompressionForce) == (59, 81.2)
    assert "StudyDate" in dataset
    assert not dataset.StudyDate
    mask = np.array(Image.open(io.BytesIO(stored_mask(image > 0, laterality))))
    assert (mask[:, first] == 255).all()


def test_an_inverted_mammogram_is_marked_so():
    image = np.full((8, 6), 100, dtype=np.uint16)
    dataset = pydicom.dcmread(io.BytesIO(mammogram_dicom(image, Subject("c", "L"), "CC", VIEW, 59.0, 80.0, True)))
    assert dataset.PhotometricInterpretation == "MONOCHROME1"
    assert (dataset.pixel_array == 3995).all()


def test_nifti_mirrors_a_left_breast():
    data = np.zeros((3, 4, 5), dtype=np.int16)
    data[0, 1, 2] = 7
    volume = Volume(data, np.array([-90.0, -10.0, 4.0]), np.full(3, 1.4))
    places = {}
    for laterality in ("R", "L"):
        image = nib.Nifti1Image.from_bytes(gzip.decompress(nifti(volume, laterality)))
        (index,) = np.argwhere(np.asarray(image.dataobj) == 7)
        places[laterality] = (image.affine @ [*index, 1.0])[:3] * [-1, -1, 1]
    np.testing.assert_allclose(places["R"], [-90.0, -8.6, 6.8], atol=1e-4)
    np.testing.assert_allclose(places["L"], [90.0, -8.6, 6.8], atol=1e-4)


@pytest.mark.parametrize("laterality", ["R", "L"])
def test_each_form_of_an_mr_volume_reads_back_the_same(tmp_path, laterality):
    data = np.random.default_rng(1).integers(0, 900, (9, 10, 11)).astype(np.int16)
    volume = Volume(data, np.array([-90.0, -10.0, 4.0]), np.array([1.4, 1.4, 1.4]))
    found = []
    for form in ("nifti", "sagittal_nifti", "dicom"):
        chosen = digital.DigitalPatient(seed=1, mr_form=form)
        for name, content in digital.mr_files(volume, chosen, Subject("c", laterality)).items():
            path = tmp_path / form / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        found.append(read_mr(path.parent if form == "dicom" else path))
    for other in found[1:]:
        np.testing.assert_allclose(other.origin, found[0].origin, atol=1e-3)
        assert np.array_equal(other.data, found[0].data)


def test_points_are_written_with_two_decimals():
    content = points_tsv(["P01"], np.array([[1.0, 2.347, -3.0]]), ("x", "y", "z"))
    assert content == b"name\tx\ty\tz\nP01\t1.00\t2.35\t-3.00\n"
