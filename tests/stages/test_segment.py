"""Stage `segment` from files to fields."""

from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Literal

import nibabel
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from pydicom import dcmread

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.anatomy import RANGES
from stages.cohort.readers.mr.volume import read_nifti
from stages.cohort.series import series_token
from stages.digital.dicom import mr_dicom
from stages.engine.artefact import Artefact, write_artefact
from stages.engine.contract import Fields, Inputs, Subject
from stages.engine.run import run_stage
from stages.report.case import case_page
from stages.segment.imaged import imaged_mm
from stages.segment.stage import Settings, run
from tests.shared_data import DATA, requires_shared
from tests.stages.mr_series import series
from tests.stages.mr_series import write as write_slices
from tests.stages.synthetic_case import header
from tests.stages.xarray_volumes import check_volumes
from tests.unit.mammogram_images import breast_image
from tests.unit.torso_phantom import RIGHT, torso

SETTINGS = Settings(spacing_mm=2.0)
RIGHT_BREAST_AND_CHEST = np.array([[-70.0, 20.0, 0.0], [-70.0, 80.0, 0.0]])


def write(volume: Volume, path: Path) -> Path:
    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    nibabel.save(nibabel.Nifti1Image(volume.data, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine), path)
    return path


def segment(files: dict[str, Path], side: Literal["L", "R"] = "R", settings: Settings = SETTINGS) -> Fields:
    return run(Inputs(files=files), settings, Subject(case="a", laterality=side))


def test_a_mirrored_patient_gives_mirrored_results(tmp_path: Path) -> None:
    patient = torso()
    mirror = replace(patient, frame="breast").to_lps("L")
    right = segment({"mr": write(patient, tmp_path / "r.nii")})
    left = segment({"mr": write(mirror, tmp_path / "l.nii")}, "L")
    for name in ("mr", "labels", "breast_mask"):
        one, other = right.volumes[name].volume, left.volumes[name].volume.to_breast("L")
        assert np.array_equal(one.data, other.data)
        assert np.allclose(one.origin, other.origin, atol=1e-9)
    for name in ("nipple", "chest_wall_surface"):
        assert np.allclose(right.arrays[name].data, left.arrays[name].data * [-1.0, 1.0, 1.0])


def test_second_volume_leaves_only_its_mask(tmp_path: Path) -> None:
    files = {"mr": write(torso(), tmp_path / "a.nii"), "mr_compressed": write(torso(), tmp_path / "b.nii")}
    fields = segment(files)
    mask = fields.volumes["compressed_mask"].volume
    assert set(np.unique(mask.data)) == {0, 1}
    assert mask.sample(RIGHT_BREAST_AND_CHEST, order=0).tolist() == [1.0, 1.0]
    assert set(fields.volumes) == {"mr", "labels", "breast_mask", "compressed_mask"}
    assert not [name for name in fields.values if "compressed" in name]
    write_artefact(tmp_path / "segment.h5", header("segment", "R"), fields)
    check_volumes(Artefact(tmp_path / "segment.h5"), {"mr", "labels", "breast_mask", "compressed_mask"})


def test_nipple_and_volume_are_those_of_the_phantom(tmp_path: Path) -> None:
    fields = segment({"mr": write(torso(), tmp_path / "a.nii")})
    assert np.linalg.norm(fields.arrays["nipple"].data - RIGHT.nipple_point()) < 7.5
    a, d, c = RIGHT.axes
    half_ellipsoid_ml = 2.0 / 3.0 * np.pi * a * d * c / 1000.0
    assert fields.values["breast_volume_ml"] == pytest.approx(half_ellipsoid_ml, rel=0.2)


def test_a_volume_that_ends_within_the_breast_is_doubted(tmp_path: Path) -> None:
    whole = torso()
    part = Volume(
        np.ascontiguousarray(whole.data[:, :, 30:64]), whole.to_world(np.array([0, 0, 30])), whole.spacing, whole.frame
    )
    rows = {
        name: {row["check"]: row for row in segment({"mr": write(volume, tmp_path / f"{name}.nii")}).values["checks"]}
        for name, volume in (("whole", whole), ("part", part))
    }
    assert rows["whole"].keys() == RANGES.keys()
    assert not any(row["doubt"] for row in rows["whole"].values())
    cut = rows["part"]["cut_by_volume"]
    assert cut["value"] > cut["high"]
    assert "end of the volume" in cut["doubt"]


@pytest.fixture(scope="module")
def imaged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A volume, and a picture whose breast is 280 pixels deep, mirrored from how a right CC is usually stored."""
    folder = tmp_path_factory.mktemp("imaged")
    Image.fromarray(np.clip(breast_image(), 0.0, 65535.0).astype(np.uint16)).save(folder / "cc.png")
    return {"mr": write(torso(), folder / "mr.nii"), "image_CC": folder / "cc.png"}


def behind_nipple(fields: Fields) -> float:
    """Posterior coordinate of the back's point behind the phantom's nipple, mm."""
    back = fields.arrays["chest_wall_surface"].data
    return float(back[np.argmin(np.hypot(*(back - RIGHT.nipple_point())[:, [0, 2]].T)), 1])


def test_a_long_breast_is_modelled_as_deep_as_its_mammograms_show(imaged: dict[str, Path]) -> None:
    found = {}
    settings = Settings(spacing_mm=2.0, long_mm=55.0)
    for pixel_mm in (None, 0.16, 0.14, 0.1):
        row = {"orientation_CC": "A\\L", "pixel_spacing_mm_CC": str(pixel_mm)}
        files = {name: path for name, path in imaged.items() if pixel_mm or name == "mr"}
        found[pixel_mm] = run(Inputs(files=files), settings, Subject("a", "R", row=row))
    back = {size: behind_nipple(fields) for size, fields in found.items()}
    assert found[None].values["imaged_mm"] is None
    assert found[0.16].values["imaged_mm"] == pytest.approx(280 * 0.16, abs=1.0)
    assert back[0.16] - back[0.14] == pytest.approx(280 * 0.02, abs=0.5)
    assert back[None] > back[0.16] + 2.0
    assert found[0.1].values["imaged_mm"] + 20.0 < 55.0
    assert back[0.14] - back[0.1] == pytest.approx(280 * 0.14 + 20.0 - 55.0, abs=0.7), "it is cut no further"
    usual = run(Inputs(files=imaged), SETTINGS, Subject("a", "R", row=row))
    assert behind_nipple(usual) == back[None], "this one is not long"


def test_what_a_mammogram_shows_is_measured_in_the_middle_between_the_plates(imaged: dict[str, Path]) -> None:
    row = {"orientation_CC": "A\\L", "pixel_spacing_mm_CC": "0.2", "source_detector_mm_CC": "660"}
    files = Inputs(files={"image_CC": imaged["image_CC"]})
    at_detector = imaged_mm(files, Subject("a", "R", row=row))
    between = imaged_mm(files, Subject("a", "R", row=row | {"thickness_mm_CC": "60"}))
    assert at_detector == pytest.approx(280 * 0.2, abs=1.0)
    assert between == pytest.approx(at_detector * (660.0 - 15.0 - 30.0) / 660.0)
    assert imaged_mm(Inputs(), Subject("a", "R")) is None


def test_a_mammogram_that_cannot_be_read_is_no_matter_of_the_segmentation(
    imaged: dict[str, Path], tmp_path: Path
) -> None:
    (tmp_path / "cc.dcm").write_bytes(b"no DICOM")
    alone, beside = segment({"mr": imaged["mr"]}), segment({"mr": imaged["mr"], "image_CC": tmp_path / "cc.dcm"})
    assert np.array_equal(alone.arrays["chest_wall_surface"].data, beside.arrays["chest_wall_surface"].data)


def test_labels_on_another_grid_are_refused(tmp_path: Path) -> None:
    patient = torso()
    labels = Volume((patient.data > 70.0).astype(np.uint8), patient.origin + 3.0, patient.spacing)
    files = {"mr": write(patient, tmp_path / "a.nii"), "mr_labels": write(labels, tmp_path / "b.nii")}
    with pytest.raises(DataError, match="another grid"):
        segment(files)


@requires_shared("victre")
def test_automatic_labels_agree_with_victre() -> None:
    """The digital breast's own labels (muscle slab, no torso), which the automatic segmentation does not see."""
    fields = segment({"mr": DATA / "victre/mr.nii.gz"}, settings=Settings())
    labels, breast = fields.volumes["labels"].volume, fields.volumes["breast_mask"].volume.data > 0
    index = labels.to_world(np.moveaxis(np.indices(labels.shape), 0, -1))
    true = read_nifti(DATA / "victre/mr_labels.nii.gz").sample(index, order=0)
    assert fields.values["fat_suppressed"] is False
    assert dice(breast, (true > 0) & (true < 4)) > 0.96
    assert dice(labels.data == 2, true == 2) > 0.88
    assert dice(labels.data > 0, true > 0) > 0.98
    assert np.linalg.norm(fields.arrays["nipple"].data - [-0.006, -60.755, -16.859]) < 4.0


@requires_shared("victre")
def test_given_labels_are_used() -> None:
    files = {"mr": DATA / "victre/mr.nii.gz", "mr_labels": DATA / "victre/mr_labels.nii.gz"}
    fields = segment(files, settings=Settings())
    labels, breast = fields.volumes["labels"].volume, fields.volumes["breast_mask"].volume.data > 0
    index = labels.to_world(np.moveaxis(np.indices(labels.shape), 0, -1))
    true = read_nifti(DATA / "victre/mr_labels.nii.gz").sample(index, order=0)
    assert dice(labels.data == 2, true == 2) > 0.99
    assert dice(breast, (true > 0) & (true < 4)) > 0.96
    assert not (labels.data[breast] == 4).any()


@pytest.mark.parametrize(
    ("mr", "side", "suppressed", "nipple", "depth_mm"),
    [
        ("twins/mr/twin4.nii.gz", "R", True, (-84.0, -82.0, -18.0), (140.0, 170.0)),
        ("mri/6f032d7b_t1_fs_pre.nii.gz", "R", True, (-52.0, -26.0, -36.0), (60.0, 140.0)),
        ("mri/69b91dc2_t1_tse_dicom", "L", False, (75.0, -20.0, -6.0), (60.0, 140.0)),
    ],
)
@requires_shared("twins")
@requires_shared("mri")
def test_real_breasts(
    mr: str,
    side: Literal["L", "R"],
    suppressed: bool,
    nipple: tuple[float, float, float],
    depth_mm: tuple[float, float],
) -> None:
    """Contrast and nipple as a reader sees them; the nipples were read off the images."""
    fields = segment({"mr": DATA / mr}, side)
    breast = fields.volumes["breast_mask"].volume
    assert fields.values["fat_suppressed"] is suppressed
    assert fields.values["warnings"] == []
    assert np.linalg.norm(fields.arrays["nipple"].data - nipple) < 8.0
    back = fields.arrays["chest_wall_surface"].data
    x, y, z = breast.centres(breast.data > 0).T
    assert np.all(x < 0.0) if side == "R" else np.all(x > 0.0)
    assert depth_mm[0] < back[:, 1].max() - y.min() < depth_mm[1]
    assert 70.0 < z.max() - z.min() < 175.0


def dice(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float(2.0 * (one & other).sum() / (one.sum() + other.sum()))


def test_series_of_a_folder_stand_in_the_artefact_and_on_the_page_without_identifiers(tmp_path: Path) -> None:
    """A patient's folder gives what its fitting series alone gives, and says which that was and what was left."""
    fit = mr_dicom(torso().to_breast("R"), Subject("a"))
    (tmp_path / "MR" / "S1").mkdir(parents=True)
    for number, content in enumerate(fit):
        (tmp_path / "MR" / "S1" / f"IM{number}").write_bytes(content)
    example = dcmread(BytesIO(fit[0]))
    patient = {"PatientID": example.PatientID, "StudyInstanceUID": example.StudyInstanceUID}
    write_slices(tmp_path / "MR" / "S7", series("t1_sub", SeriesNumber=7, **patient))
    row = {"mr_series": series_token(example.SeriesInstanceUID)}
    for name, given in (("folder", {}), ("named", row)):
        fields = run_stage(
            "segment",
            {"mr": tmp_path / "MR"},
            tmp_path / f"{name}.h5",
            {"spacing_mm": 2.0},
            Subject("a", "R", row=given),
        )
        assert fields.status == "ok", fields.message
    sections = case_page("a", "R", [Artefact(tmp_path / "folder.h5")]).sections
    (section,) = [one for one in sections if one.heading == "MR series in the folder"]
    assert section.rows[0][1].startswith("series 1, ")
    assert section.rows[0][2] == "taken"
    assert (section.rows[1][1][:8], section.rows[1][2]) == ("series 7", "subtraction")
    for name in ("folder", "named"):
        content = (tmp_path / f"{name}.h5").read_bytes()
        secrets = (example.SeriesInstanceUID, example.SOPInstanceUID, "DIGITAL-A", "t1_sub")
        assert not any(secret.encode() in content for secret in secrets)
    alone = segment({"mr": tmp_path / "MR" / "S1"})
    mask = Artefact(tmp_path / "folder.h5").volume("breast_mask")
    assert np.array_equal(mask.data, alone.volumes["breast_mask"].volume.data)
