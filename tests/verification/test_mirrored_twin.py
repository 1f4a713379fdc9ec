"""A twin mirrored in the sagittal plane, and its images stored flipped, get the mirrored predictions."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from PIL import Image
from pydicom import dcmread

from stages.engine.artefact import Artefact
from tests.shared_data import DATA, requires_shared
from tests.verification.case_run import Given, run_case

TWINS = DATA / "twins"
CASE, VIEWS, PIXEL_MM, CLOSE_MM = "twin1", ("CC", "MLO"), 0.2, 0.1
SETTINGS = {
    "mesh": {"elements": 5},
    "pose": {"angle_step_deg": 6.0, "angle_bound_deg": 6.0},
    "compress": {"load_steps": 5},
    "shape": {"rounds": 2},
}
pytestmark = requires_shared("twins/mg")
Artefacts = dict[str, Artefact]


def _marks(folder: Path) -> dict[str, Path]:
    marks = {"mr_lesion": folder / f"mr/{CASE}_lesion.nii.gz", "mr_landmarks": folder / f"points/{CASE}_mr.tsv"}
    return marks | {f"lesion_{view}": folder / f"mg/{CASE}_{view}_lesion.png" for view in VIEWS}


def _given(folder: Path, laterality: str) -> Given:
    images = {view: folder / f"mg/{CASE}_{view}.dcm" for view in VIEWS}
    return Given(laterality, folder / f"mr/{CASE}.nii.gz", images, _marks(folder))


def _mirror_volume(source: Path, target: Path) -> None:
    """Patient x changes its sign; the voxels stay in the file as they were."""
    image = nibabel.load(source)
    nibabel.save(nibabel.Nifti1Image(np.asanyarray(image.dataobj), np.diag([-1.0, 1, 1, 1]) @ image.affine), target)


def _mirror_points(source: Path, target: Path) -> None:
    header, *lines = source.read_text().splitlines()
    assert header.split("\t")[:4] == ["name", "x", "y", "z"]
    rows = [line.split("\t") for line in lines]
    target.write_text("\n".join([header, *("\t".join([r[0], str(-float(r[1])), *r[2:]]) for r in rows)]) + "\n")


def _store(source: Path, target: Path, orientation: list[str], side: str, flips: tuple[bool, bool]) -> None:
    """The image and its lesion mask with rows and columns flipped."""
    header = dcmread(source)
    pixels = header.pixel_array[:: -1 if flips[0] else 1, :: -1 if flips[1] else 1]
    header.PixelData = np.ascontiguousarray(pixels).tobytes()
    header.PatientOrientation, header.ImageLaterality = orientation, side
    header.save_as(target)
    mask = np.asarray(Image.open(source.with_name(f"{source.stem}_lesion.png")))
    flipped = mask[:: -1 if flips[0] else 1, :: -1 if flips[1] else 1]
    Image.fromarray(np.ascontiguousarray(flipped)).save(target.with_name(f"{target.stem}_lesion.png"))


def _copy(folder: Path, stored: dict[str, tuple[list[str], tuple[bool, bool]]], side: str) -> Path:
    for name in ("mr", "mg", "points"):
        (folder / name).mkdir(parents=True)
    for view, (orientation, flips) in stored.items():
        name = f"mg/{CASE}_{view}.dcm"
        _store(TWINS / name, folder / name, orientation, side, flips)
    return folder


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Artefacts:
    return run_case(_given(TWINS, "R"), tmp_path_factory.mktemp("original"), SETTINGS)


@pytest.fixture(scope="module")
def mirrored(tmp_path_factory: pytest.TempPathFactory) -> Artefacts:
    """The left breast with images as a unit usually stores them: the mirrored rows run the other way."""
    stored = {"CC": (["A", "R"], (False, True)), "MLO": (["A", "FR"], (False, True))}
    folder = _copy(tmp_path_factory.mktemp("left"), stored, "L")
    for name in (f"{CASE}.nii.gz", f"{CASE}_lesion.nii.gz"):
        _mirror_volume(TWINS / "mr" / name, folder / "mr" / name)
    _mirror_points(TWINS / f"points/{CASE}_mr.tsv", folder / f"points/{CASE}_mr.tsv")
    return run_case(_given(folder, "L"), tmp_path_factory.mktemp("mirrored"), SETTINGS)


def _pixels(artefacts: Artefacts) -> dict[tuple[str, str, str], np.ndarray]:
    rows = artefacts["localize"].value("mammogram_rows")
    return {(r["view"], r["method"], r["name"]): np.array([r["column"], r["row"]], dtype=float) for r in rows}


def _places(artefacts: Artefacts) -> dict[tuple[str, str], np.ndarray]:
    rows = artefacts["localize"].value("mr_rows")
    return {(r["method"], r["name"]): np.array([r["x"], r["y"], r["z"]], dtype=float) for r in rows}


def test_every_stage_of_the_twin_ends_well(original: Artefacts) -> None:
    assert {name: a.message for name, a in original.items() if not a.ok} == {}
    found = _pixels(original)
    assert len(found) == len(VIEWS) * 4 * (1 + 30)
    assert sum(np.isfinite(place).all() for place in found.values()) > 0.7 * len(found)
    assert set(_places(original)) == {(m, "lesion") for m in ("rigid", "scaling", "plate", "updated")}


def test_mirrored_breast_has_the_mirrored_predictions_in_the_mammograms(
    original: Artefacts, mirrored: Artefacts
) -> None:
    mine, other = _pixels(original), _pixels(mirrored)
    assert mine.keys() == other.keys()
    for key, (column, row) in mine.items():
        columns = original[f"pose.{key[0]}"].value("stored_columns")
        expected = [columns - 1 - column, row]
        assert other[key] == pytest.approx(expected, abs=CLOSE_MM / PIXEL_MM, nan_ok=True), key


def test_mirrored_breast_has_the_mirrored_places_in_mr(original: Artefacts, mirrored: Artefacts) -> None:
    mine, other = _places(original), _places(mirrored)
    assert mine.keys() == other.keys()
    for key, place in mine.items():
        assert other[key] == pytest.approx(place * [-1.0, 1.0, 1.0], abs=CLOSE_MM), key


def test_images_stored_flipped_have_the_flipped_predictions(original: Artefacts, tmp_path: Path) -> None:
    """CC from left to right, as a right CC with the chest wall on the left; MLO turned by half a turn."""
    stored = {"CC": (["A", "L"], (False, True)), "MLO": (["A", "HR"], (True, True))}
    folder = _copy(tmp_path / "flipped", stored, "R")
    flipped = Given(
        "R",
        TWINS / f"mr/{CASE}.nii.gz",
        _given(folder, "R").images,
        _marks(TWINS) | {f"lesion_{view}": folder / f"mg/{CASE}_{view}_lesion.png" for view in VIEWS},
    )
    found = run_case(flipped, tmp_path / "results", SETTINGS)
    mine, other = _pixels(original), _pixels(found)
    assert mine.keys() == other.keys()
    for key, (column, row) in mine.items():
        pose = original[f"pose.{key[0]}"]
        rows, columns = pose.value("stored_rows"), pose.value("stored_columns")
        expected = [columns - 1 - column, rows - 1 - row if key[0] == "MLO" else row]
        assert other[key] == pytest.approx(expected, abs=CLOSE_MM / PIXEL_MM, nan_ok=True), key
    for key, place in _places(original).items():
        assert _places(found)[key] == pytest.approx(place, abs=CLOSE_MM), key
