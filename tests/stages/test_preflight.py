"""Preflight: each kind of bad file with the message that a user reads."""

import nibabel
import numpy as np
import pytest
from PIL import Image

from stages.cohort.cases import read_cohort
from stages.cohort.preflight import check_cohort, choices_of, warnings_of
from tests.shared_data import DATA, requires_shared
from tests.stages.cohort_files import (
    AFFINE,
    COLUMNS,
    ROWS,
    SHAPE,
    ball,
    write_cohort,
    write_dicom,
    write_tsv,
    write_volume,
)
from tests.stages.mr_series import series, write


@pytest.fixture
def folder(tmp_path):
    return write_cohort(tmp_path)


def _faults(folder):
    return [str(fault) for fault in check_cohort(read_cohort(folder / "cases.tsv", folder / "views.tsv"))]


def _assert_only(folder, *parts):
    (fault,) = _faults(folder)
    for part in parts:
        assert part in fault


def test_good_cohort_has_no_fault(folder):
    assert _faults(folder) == []


def test_missing_file(folder):
    (folder / "mr.nii.gz").unlink()
    _assert_only(
        folder,
        "cases.tsv (c1), column mr: there is no file",
        "correct the path, which is relative to the table's folder",
    )


def test_all_missing_files_are_listed(folder):
    for name in ("mr.nii.gz", "cc.dcm", "lesion.png", "points.tsv"):
        (folder / name).unlink()
    assert len(_faults(folder)) == 4


@pytest.mark.parametrize(
    ("name", "column", "message"),
    [
        ("mr.nii.gz", "mr", "cannot be read as NIfTI; export the volume again"),
        ("mr_lesion.nii.gz", "mr_lesion", "cannot be read as NIfTI; export the volume again"),
        ("cc.dcm", "image", "cannot be read as DICOM; name a DICOM mammogram, a .png or a .tif"),
        ("lesion.png", "lesion", "cannot be read as a picture; write the mask again as .png"),
        ("points.tsv", "mr_landmarks", "cannot be read as a tab-separated table"),
    ],
)
def test_unreadable_file(folder, name, column, message):
    (folder / name).write_bytes(b"\xff\xfe\x00 rubbish")
    _assert_only(folder, f"column {column}: ", message)


def test_mammogram_of_another_modality(folder):
    write_dicom(folder / "cc.dcm", Modality="CR")
    _assert_only(folder, "views.tsv (c1 CC), column image", "modality is CR, not MG; name a mammogram")


def test_mr_folder_of_another_modality(folder):
    (folder / "series").mkdir()
    write_dicom(folder / "series" / "IM1")
    _with_mr(folder, "series")
    _assert_only(folder, "column mr: ", "modality is MG, not MR; name the folder of an MR series, or of the patient")


def test_mr_folder_without_dicom(folder):
    (folder / "series").mkdir()
    _with_mr(folder, "series")
    _assert_only(folder, "column mr: ", "holds no DICOM image; name the folder of an MR series, or of the patient")


def test_mr_that_is_a_mammogram(folder):
    _with_mr(folder, "cc.dcm")
    _assert_only(folder, "column mr: ", "modality is MG, not MR; name the folder of an MR series, or of the patient")


def test_mr_that_is_a_table(folder):
    _with_mr(folder, "points.tsv")
    _assert_only(folder, "is neither NIfTI nor DICOM; give .nii, .nii.gz or the folder of an MR series")


def _with_mr(folder, name):
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": name})


def test_empty_lesion_masks(folder):
    write_volume(folder / "mr_lesion.nii.gz", np.zeros(SHAPE, np.uint8))
    Image.fromarray(np.zeros((ROWS, COLUMNS), np.uint8)).save(folder / "lesion.png")
    faults = _faults(folder)
    assert len(faults) == 2
    assert all("the lesion mask is empty; mark the lesion or leave the cell empty" in fault for fault in faults)


def test_lesion_masks_of_several_components_name_the_table_form(folder):
    write_volume(folder / "mr_lesion.nii.gz", ball(SHAPE, (3, 3, 3), (8, 8, 8)))
    Image.fromarray(255 * ball((ROWS, COLUMNS), (10, 10), (30, 20), (20, 25))).save(folder / "lesion.png")
    first, second = _faults(folder)
    assert "the lesion mask has 2 components; list several lesions in a .tsv" in first
    assert "the lesion mask has 3 components; list several lesions in a .tsv" in second


def test_lesion_mask_on_another_grid(folder):
    moved = AFFINE.copy()
    moved[0, 3] = 5.0
    write_volume(folder / "mr_lesion.nii.gz", ball(SHAPE, (5, 6, 7)), moved)
    _assert_only(folder, "lies on another grid than mr: the same voxels, but (-5.00, 0.00, 0.00) mm off (LPS)")
    moved[0, 3] = 0.2
    write_volume(folder / "mr_lesion.nii.gz", ball(SHAPE, (5, 6, 7)), moved)
    _assert_only(folder, "but (-0.20, 0.00, 0.00) mm off (LPS); resample it onto the MR grid")
    write_volume(folder / "mr_lesion.nii.gz", ball(SHAPE, (5, 6, 7)), np.diag([-1.4, -1.4, 2.8, 1.0]))
    _assert_only(
        folder, "lies on another grid (12 x 14 x 16 voxels of 1.4 x 1.4 x 2.8 mm around (8, 9, 21)) than mr (12"
    )


def test_lesion_mask_with_turned_axes_is_on_the_same_grid(folder):
    mask = ball(SHAPE, (5, 6, 7))
    turned = AFFINE.copy()
    turned[0, 0], turned[0, 3] = 1.4, -1.4 * (SHAPE[0] - 1)
    write_volume(folder / "mr_lesion.nii.gz", mask[::-1], turned)
    assert _faults(folder) == []


def test_lesion_mask_of_another_size_than_the_mammogram(folder):
    Image.fromarray(255 * ball((ROWS + 1, COLUMNS), (20, 10))).save(folder / "lesion.png")
    _assert_only(folder, "the mask has 41 x 30 pixels (rows x columns)", "40 x 30; draw it on the image as stored")


def test_unknown_labels(folder):
    write_volume(folder / "mr_labels.nii.gz", np.full(SHAPE, 7, np.uint8))
    _assert_only(folder, "holds the labels 7; known are 0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall")


def test_labels_that_a_scale_factor_has_rounded(folder):
    write_volume(folder / "mr_labels.nii.gz", np.full(SHAPE, 0.9999998, np.float32))
    assert _faults(folder) == []
    write_volume(folder / "mr_labels.nii.gz", np.full(SHAPE, 1.4, np.float32))
    _assert_only(folder, "holds the labels 1.39999998; known are 0 background")


def test_a_volume_without_orientation_is_blamed_itself(folder):
    image = nibabel.load(folder / "mr.nii.gz")
    image.set_sform(None, 0)
    image.set_qform(None, 0)
    image.to_filename(folder / "mr.nii.gz")
    _assert_only(folder, "column mr: ", "mr.nii.gz: the header gives no orientation (sform and qform are unset)")


def test_points_in_another_frame(folder):
    """The volume spans 0 to 15, 18 and 21 mm."""
    rows = [{"name": f"P{n}", "x": f"-{n}", "y": "-2", "z": "3"} for n in range(3, 8)]
    write_tsv(folder / "points.tsv", *rows)
    _assert_only(
        folder,
        "column mr_landmarks",
        "P3, P4, P5 and 2 more lie outside the MR volume (x 0 to 15, y 0 to 18, z 0 to 21 mm, LPS)",
        "with x and y negated all lie inside, so they seem to be RAS: give LPS coordinates",
    )
    write_tsv(folder / "points.tsv", {"name": "P1", "x": "1", "y": "2", "z": "-9"})
    _assert_only(folder, "P1 lies outside", "with z negated all lie inside: give LPS")
    write_tsv(folder / "points.tsv", {"name": "P1", "x": "1", "y": "2", "z": "90"})
    _assert_only(folder, "P1 lies outside", "give LPS coordinates in mm in the frame of this volume")
    write_tsv(folder / "points.tsv", {"name": "P1", "x": "-1.3", "y": "2", "z": "22.3"})
    assert _faults(folder) == [], "within a voxel of the border"


def test_lesion_outside_the_volume(folder):
    lesion = {"name": "mass", "x": "-5", "y": "-6", "z": "7", "diameter_mm": "4"}
    write_tsv(folder / "mass.tsv", lesion)
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "mr.nii.gz", "mr_lesion": "mass.tsv"})
    _assert_only(folder, "column mr_lesion", "mass lies outside the MR volume", "they seem to be RAS")


def test_pixels_off_the_picture(folder):
    write_tsv(folder / "pixels.tsv", {"name": "P1", "column": "35", "row": "4"})
    _assert_only(
        folder,
        "column landmarks",
        "P1 lies outside the picture (30 columns, 40 rows); with column and row exchanged all lie on it",
    )
    write_tsv(folder / "pixels.tsv", {"name": "P1", "column": "3", "row": "4"})
    write_tsv(folder / "lesion.tsv", {"name": "m", "column": "3", "row": "99", "diameter_mm": "5"})
    write_tsv(folder / "views.tsv", {"case": "c1", "view": "CC", "image": "cc.dcm", "lesion": "lesion.tsv"})
    _assert_only(folder, "column lesion", "m lies outside the picture", "the first pixel being 0 0")


def test_zero_spacing_of_the_volume(folder):
    path = folder / "mr.nii"
    write_volume(path)
    content = bytearray(path.read_bytes())
    content[80:92] = np.array([1.4, 0.0, 1.4], "<f4").tobytes()
    path.write_bytes(bytes(content))
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "mr.nii"})
    _assert_only(folder, "the header's voxel spacing is 1.4 x 0 x 1.4 mm; correct it or export the volume again")


def test_spacing_that_is_no_breast_mr(folder):
    write_volume(folder / "mr.nii.gz", affine=np.diag([0.001, 0.001, 0.001, 1.0]))
    assert any("the voxel spacing is 0.001 x 0.001 x 0.001 mm, outside 0.1 to 15" in fault for fault in _faults(folder))


def test_volume_that_is_one_slice(folder):
    write_volume(folder / "mr.nii.gz", np.ones((30, 30, 1), np.float32))
    assert any("has 30 x 30 x 1 voxels, which is no volume" in fault for fault in _faults(folder))


def test_zero_spacing_of_the_mammogram(folder):
    write_dicom(folder / "cc.dcm", ImagerPixelSpacing=[0.0, 0.0])
    _assert_only(folder, "column image", "pixel_spacing_mm")


def test_mammogram_without_spacing(folder):
    write_dicom(folder / "cc.dcm", ImagerPixelSpacing=None)
    _assert_only(folder, "neither header nor table gives the pixel spacing; fill the column pixel_spacing_mm")


def test_laterality_that_contradicts_the_header(folder):
    write_dicom(folder / "cc.dcm", ImageLaterality="L")
    _assert_only(
        folder, "the header's ImageLaterality is L, the table's laterality is R", "correct cases.tsv or name the image"
    )


def test_view_that_contradicts_the_header(folder):
    write_dicom(folder / "cc.dcm", ViewPosition="MLO")
    _assert_only(
        folder, "the header's ViewPosition is MLO, the table's view is CC", "correct views.tsv or name the image"
    )


def test_points_without_common_names(folder):
    write_volume(folder / "mr_2.nii.gz")
    write_tsv(folder / "other.tsv", {"name": "Q1", "x": "1", "y": "2", "z": "3"})
    row = {"case": "c1", "laterality": "R", "mr": "mr.nii.gz", "mr_landmarks": "points.tsv"}
    write_tsv(folder / "cases.tsv", row | {"mr_compressed": "mr_2.nii.gz", "mr_compressed_landmarks": "other.tsv"})
    _assert_only(
        folder, "column mr_compressed_landmarks", "shares no name with", "give corresponding points the same names"
    )


def test_excluded_rows_and_files_that_the_workflow_makes_are_not_opened(folder):
    (folder / "mr.nii.gz").unlink()
    cohort = read_cohort(folder / "cases.tsv", folder / "views.tsv")
    assert check_cohort(cohort, {folder / "mr.nii.gz"}) == []
    row = {"case": "c2", "laterality": "R", "mr": "nowhere.nii.gz", "exclude": "implant"}
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "mr_labels.nii.gz"}, row)
    assert _faults(folder) == []


def test_no_patient_in_any_message(folder):
    write_dicom(
        folder / "cc.dcm", ImageLaterality="L", PatientName="Doe^Jane", PatientID="4711", PatientBirthDate="19700101"
    )
    (fault,) = _faults(folder)
    assert not any(secret in fault for secret in ("Doe", "4711", "1970"))


@requires_shared("twins")
@pytest.mark.parametrize("name", ["twins", "victre", "mri"])
def test_development_data_pass(name):
    views = DATA / name / "views.tsv"
    assert check_cohort(read_cohort(DATA / name / "cases.tsv", views if views.exists() else None)) == []


def _cut(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


@pytest.mark.parametrize("share", [0.5, 0.98])
def test_compressed_volume_that_ends_early(folder, share):
    _cut(folder / "mr.nii.gz", share)
    assert "column mr: " in _faults(folder)[0]
    assert any("mr.nii.gz: ends early or is damaged" in fault for fault in _faults(folder))


def test_damage_inside_a_compressed_volume(folder):
    content = bytearray((folder / "mr.nii.gz").read_bytes())
    content[-6] ^= 0xFF  # in the checksum: every voxel is there, but not as it was written
    (folder / "mr.nii.gz").write_bytes(bytes(content))
    _assert_only(folder, "column mr: ", "mr.nii.gz: ends early or is damaged")


def test_plain_volume_shorter_than_its_header_says(folder):
    write_volume(folder / "mr.nii")
    table = folder / "cases.tsv"
    table.write_text(table.read_text().replace("\tmr.nii.gz", "\tmr.nii"))
    assert _faults(folder) == []
    size = (folder / "mr.nii").stat().st_size
    (folder / "mr.nii").write_bytes((folder / "mr.nii").read_bytes()[:-1])
    _assert_only(folder, f"mr.nii: holds {size - 1} of the {size} bytes that its header promises")


def test_mammogram_with_too_few_pixels(folder):
    write_dicom(folder / "cc.dcm", PixelData=np.zeros((ROWS - 1, COLUMNS), np.uint16).tobytes())
    _assert_only(folder, "views.tsv (c1 CC), column image: ", "of the 2400 bytes of its pixels")


def test_mammogram_without_pixels(folder):
    write_dicom(folder / "cc.dcm", PixelData=None)
    _assert_only(folder, "cc.dcm: holds no pixels")


def test_picture_that_ends_early(folder):
    noise = np.random.default_rng(1).integers(0, 255, (ROWS, COLUMNS), dtype=np.uint8)
    Image.fromarray(noise).save(folder / "cc.png")
    view = {"case": "c1", "view": "CC", "image": "cc.png", "pixel_spacing_mm": "1", "lesion": "lesion.png"}
    write_tsv(folder / "views.tsv", view)
    assert _faults(folder) == []
    _cut(folder / "cc.png", 0.6)
    assert any("cc.png: ends early or is damaged" in fault for fault in _faults(folder))


def test_a_series_of_one_volume(folder):
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "mr.nii.gz", "mr_series": "4"})
    _assert_only(folder, "column mr: ", "is one volume, and the column mr_series names a series; leave one of them out")


def test_the_series_that_is_taken_is_named_with_what_was_left(folder):
    """Of the folder of a patient `check` tells which series it takes, and a mask is held against that one's grid."""
    write(folder / "MR" / "a", series("t1", SeriesNumber=4))
    write(folder / "MR" / "b", series("t1 sub", SeriesNumber=5, count=12))
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "MR", "mr_labels": "mr_labels.nii.gz"})
    write_tsv(folder / "views.tsv", {"case": "c1", "view": "CC", "image": "cc.dcm"})
    assert "than mr (10 x 12 x 9 voxels of 1.5 x 1.5 x 2 mm" in _faults(folder)[0]
    taken, left = choices_of(read_cohort(folder / "cases.tsv", folder / "views.tsv"))
    assert taken.startswith("cases.tsv (c1), column mr: series 4, T1")
    assert left == ("  left: series 5, T1, 3D, echo 1.7 ms, axial 10 x 12 x 12 voxels of 1.5 x 1.5 x 2 mm: subtraction")


@pytest.mark.parametrize(("birthday", "told"), [("19650101", True), ("19700101", False), ("", False)])
def test_a_mammogram_of_another_woman(folder, birthday, told):
    """Other number and birthday than the MR's are a fault; another number alone is remarked, and neither is quoted."""
    write(folder / "MR", series("t1"))
    write_tsv(folder / "cases.tsv", {"case": "c1", "laterality": "R", "mr": "MR"})
    write_tsv(folder / "views.tsv", {"case": "c1", "view": "CC", "image": "cc.dcm"})
    write_dicom(folder / "cc.dcm", PatientID="4711", PatientBirthDate=birthday)
    faults, remarks = _faults(folder), warnings_of(read_cohort(folder / "cases.tsv", folder / "views.tsv"))
    (said,) = [line for line in (faults if told else remarks) if "name different patients" in line]
    assert len(faults) == told
    assert not any(secret in said for secret in ("4711", "1965", "1970", "Doe"))
    write_dicom(folder / "cc.dcm", PatientID="ID-Doe^Jane", PatientBirthDate=birthday)
    assert _faults(folder) == []
    assert not warnings_of(read_cohort(folder / "cases.tsv", folder / "views.tsv"))


@pytest.mark.parametrize(
    ("old", "new"), [(b"UL\x04\x00", b"UL\x03\x00"), (b"1.2.840.10008.1.2.1\0", b"8.2.840.10008.1.2.1\0")]
)
def test_mammogram_whose_first_bytes_are_damaged(folder, old, new):
    path = folder / "cc.dcm"
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    _assert_only(folder, "cc.dcm: ")


def test_what_trust_will_say_of_a_mammograms_header_is_told(folder):
    cohort = read_cohort(folder / "cases.tsv", folder / "views.tsv")
    assert warnings_of(cohort) == []
    write_dicom(folder / "cc.dcm", BodyPartThickness="7.2", BreastImplantPresent="YES")
    assert warnings_of(cohort) == [
        "views.tsv (c1 CC), column image: breast implant, which the model does not know: do not trust",
        "views.tsv (c1 CC), column image: BodyPartThickness 7.2 read as cm",
    ]
