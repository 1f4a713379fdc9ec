"""Stage `localize` on a breast whose compression is known in closed form."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import SimpleITK
from PIL import Image

from mammoreg.geometry import breast_to_lps, plate_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.lesions import LesionArea, area_from_disc
from mammoreg.metrics.distances import breast_scale_mm
from stages.annotations import landmarks_in_air
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Inputs, Subject
from stages.engine.run import run_stage
from stages.localize.strays import strays_in_mammogram
from stages.methods import METHODS
from tests.stages import synthetic_case as synthetic
from tests.stages.xarray_volumes import check_volumes

LESION = np.array([12.0, -40.0, 9.0])
POINTS = {"p1": np.array([-20.0, -30.0, 15.0]), "p2": np.array([5.0, -60.0, -25.0]), "deep": np.array([0.0, 12.0, 0.0])}


def write_tsv(path: Path, columns: str, rows: dict[str, Any]) -> Path:
    lines = ["\t".join(columns.split())]
    lines += ["\t".join([name, *(f"{x:.6f}" for x in np.ravel(numbers))]) for name, numbers in rows.items()]
    path.write_text("\n".join(lines) + "\n")
    return path


def mr_marks(folder: Path, laterality: Laterality) -> dict[str, Path]:
    lesion = {"mass": [*breast_to_lps(LESION, laterality), 10.0]}
    points = {name: breast_to_lps(point, laterality) for name, point in POINTS.items()}
    return {
        "mr_lesion": write_tsv(folder / "lesion.tsv", "name x y z diameter_mm", lesion),
        "mr_landmarks": write_tsv(folder / "landmarks.tsv", "name x y z", points),
    }


def view_marks(folder: Path, views: tuple[str, ...], flips: tuple[bool, bool]) -> dict[str, Path]:
    return {
        f"lesion_{view}": write_tsv(
            folder / f"lesion_{view}.tsv",
            "name column row diameter_mm",
            {"mass": [*synthetic.stored(synthetic.true_pixel(view, LESION), flips), 10.0 * synthetic.SHRINK**-0.5]},
        )
        for view in views
    }


def localized(inputs: dict[str, Any], output: Path, laterality: Laterality = "R") -> Artefact:
    run_stage("localize", inputs, output, {}, Subject("case1", laterality))
    return Artefact(output)


def rows_of(artefact: Artefact, name: str, method: str = "updated") -> list[dict[str, Any]]:
    return [row for row in artefact.value(name) if row["method"] == method]


@pytest.fixture(scope="module")
def both_ways(tmp_path_factory: pytest.TempPathFactory) -> Artefact:
    folder = tmp_path_factory.mktemp("both")
    inputs = synthetic.write_case(folder, compressed=True)
    marks = mr_marks(folder, "R") | view_marks(folder, ("CC", "MLO"), (False, False))
    return localized(inputs | marks, folder / "localize.h5")


def test_xarray_opens_the_regions(both_ways: Artefact) -> None:
    check_volumes(both_ways, {f"mr/{method}/lesion0/region" for method in METHODS})


@pytest.mark.parametrize("method", ["scaling", "plate", "updated"])
def test_mammogram_shows_what_the_mr_marks(both_ways: Artefact, method: str) -> None:
    rows = {(r["view"], r["name"]): r for r in rows_of(both_ways, "mammogram_rows", method)}
    for view in ("CC", "MLO"):
        for name, point in {"mass": LESION, "p1": POINTS["p1"], "p2": POINTS["p2"]}.items():
            row = rows[view, name]
            assert row["seen"]
            np.testing.assert_allclose([row["column"], row["row"]], synthetic.true_pixel(view, point), atol=0.6)
        assert rows[view, "deep"] == {
            "view": view, "method": method, "name": "deep", "column": None, "row": None, "radius_mm": None,
            "seen": False, "message": "outside the imaged part",
        }  # fmt: skip


@pytest.mark.parametrize("method", ["scaling", "plate", "updated"])
def test_mr_shows_what_both_mammograms_mark(both_ways: Artefact, method: str) -> None:
    (row,) = rows_of(both_ways, "mr_rows", method)
    assert (row["views"], row["name"], row["message"]) == ("CC+MLO", "mass", "")
    np.testing.assert_allclose([row["x"], row["y"], row["z"]], LESION, atol=0.6)
    assert row["beam_gap_mm"] < 0.3
    assert row["nipple_distance_mm"] == pytest.approx(np.linalg.norm(LESION - [0, -synthetic.DEPTH, 0]), abs=0.6)
    assert row["clock"] == "2:00"
    assert row["skin_depth_mm"] == pytest.approx(30.0, abs=0.8)
    assert row["chest_wall_depth_mm"] == pytest.approx(40.0, abs=0.8)
    region = both_ways.volume(f"mr/{method}/lesion0/region")
    np.testing.assert_allclose(region.centres(region.data != 0).mean(axis=0), LESION, atol=0.6)


def test_the_second_volume_is_placed_by_its_outline(both_ways: Artefact) -> None:
    rows = {row["name"]: row for row in rows_of(both_ways, "compressed_rows")}
    for name, point in POINTS.items():
        if name == "deep":
            continue
        angle = synthetic.geometry("CC").angle_deg
        carried = plate_to_breast(synthetic.compression("CC").forward(point[None])[0], angle)
        found = [rows[name][axis] for axis in "xyz"]
        np.testing.assert_allclose(found, carried + synthetic.SECOND_VOLUME_SHIFT, atol=0.6)
    assert len(rows_of(both_ways, "compressed_rows", "rigid")) == len(POINTS)


def test_without_mammogram_the_second_volume_places_the_result(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("3D",), compressed=True) | mr_marks(tmp_path, "R")
    found = localized(inputs, tmp_path / "localize.h5")
    assert found.value("mammogram_rows") == []
    row = next(row for row in rows_of(found, "compressed_rows", "plate") if row["name"] == "p1")
    carried = plate_to_breast(synthetic.compression("3D").forward(POINTS["p1"][None])[0], 3.0)
    np.testing.assert_allclose([row[axis] for axis in "xyz"], carried + synthetic.SECOND_VOLUME_SHIFT, atol=1.0)


@pytest.mark.parametrize("flips", [(False, True), (True, False), (True, True)])
def test_mirrored_patient_and_flipped_images_give_mirrored_predictions(
    both_ways: Artefact, tmp_path: Path, flips: tuple[bool, bool]
) -> None:
    inputs = synthetic.write_case(tmp_path, "L", flips=flips, compressed=True)
    marks = mr_marks(tmp_path, "L") | view_marks(tmp_path, ("CC", "MLO"), flips)
    mirrored = localized(inputs | marks, tmp_path / "localize.h5", "L")
    for right, left in zip(both_ways.value("mammogram_rows"), mirrored.value("mammogram_rows"), strict=True):
        assert right["seen"] == left["seen"]
        if right["seen"]:
            expected = synthetic.stored(np.array([right["column"], right["row"]]), flips)
            np.testing.assert_allclose([left["column"], left["row"]], expected, atol=1e-6)
    for name in ("mr_rows", "compressed_rows"):
        for right, left in zip(both_ways.value(name), mirrored.value(name), strict=True):
            np.testing.assert_allclose([-left["x"], left["y"], left["z"]], [right[a] for a in "xyz"], atol=1e-4)
    assert mirrored.value("mr_rows")[0]["clock"] == "10:00"


def test_directions_do_not_read_each_others_marks(both_ways: Artefact, tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, compressed=True)
    only_mr = localized(inputs | mr_marks(tmp_path, "R"), tmp_path / "mr.h5")
    only_views = localized(inputs | view_marks(tmp_path, ("CC", "MLO"), (False, False)), tmp_path / "views.h5")
    assert only_mr.value("mammogram_rows") == both_ways.value("mammogram_rows")
    assert only_mr.value("compressed_rows") == both_ways.value("compressed_rows")
    assert only_mr.value("mr_rows") == []
    assert only_views.value("mr_rows") == both_ways.value("mr_rows")
    assert only_views.value("mammogram_rows") == only_views.value("compressed_rows") == []


def test_marks_of_3d_slicer_are_those_of_the_tables(both_ways: Artefact, tmp_path: Path) -> None:
    """Landmarks in RAS, and the lesion as a cropped segment on a grid of its own."""
    columns = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"
    lines = ["# Markups fiducial file version = 5.6", "# CoordinateSystem = RAS", f"# columns = {columns}"]
    lines += [f"1,{-p[0]},{-p[1]},{p[2]},0,0,0,1,1,1,0,{name},," for name, p in POINTS.items()]
    (tmp_path / "F.fcsv").write_text("\n".join(lines) + "\n")
    axis = np.arange(-12, 13) * 0.5
    ball = np.linalg.norm(np.meshgrid(axis, axis, axis, indexing="ij"), axis=0) <= 5.0
    image = SimpleITK.GetImageFromArray(ball.astype(np.uint8))
    image.SetSpacing([0.5] * 3)
    image.SetOrigin((LESION - 6.0).tolist())
    for key, value in (("ID", "s"), ("Name", "mass"), ("LabelValue", "1"), ("Layer", "0")):
        image.SetMetaData(f"Segment0_{key}", value)
    SimpleITK.WriteImage(image, str(tmp_path / "mass.seg.nrrd"))
    marks = {"mr_lesion": tmp_path / "mass.seg.nrrd", "mr_landmarks": tmp_path / "F.fcsv"}
    found = localized(synthetic.write_case(tmp_path) | marks, tmp_path / "localize.h5")
    expected = {(r["view"], r["name"]): r for r in rows_of(both_ways, "mammogram_rows")}
    for row in rows_of(found, "mammogram_rows"):
        other = expected[row["view"], "mass" if row["name"] == "lesion" else row["name"]]
        assert row["seen"] == other["seen"]
        if row["seen"]:
            np.testing.assert_allclose([row["column"], row["row"]], [other["column"], other["row"]], atol=0.2)


def _marked_at(folder: Path, lps: np.ndarray, diameter_mm: float = 10.0) -> dict[str, Path]:
    """The lesion called mass at a place, and one called sound where it belongs."""
    lesions = {"mass": [*lps, diameter_mm], "sound": [*LESION, 10.0]}
    return {"mr_lesion": write_tsv(folder / "strays.tsv", "name x y z diameter_mm", lesions)}


@pytest.mark.parametrize(
    ("lps", "says"),
    [
        (
            LESION * [-1.0, -1.0, 1.0],
            "breast, 41 mm from the R breast's model; with x and y negated it lies inside (RAS",
        ),
        (np.array([10.0, -40.0, 80.0]), "37 mm from the R breast's model; check its frame and the laterality"),
        (np.array([75.0, -40.0, 0.0]), "from the R breast's model, towards the other breast"),
        (np.array([0.0, -74.9, 0.0]), "marked in the air or outside the breast, 6 mm from the R breast"),
    ],
)
def test_a_lesion_marked_outside_the_breast_is_flagged(tmp_path: Path, lps: np.ndarray, says: str) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    rows = {
        r["name"]: r
        for r in rows_of(localized(inputs | _marked_at(tmp_path, lps), tmp_path / "l.h5"), "mammogram_rows")
    }
    assert says in rows["mass"]["message"]
    assert (rows["sound"]["seen"], rows["sound"]["message"]) == (True, "")


def test_nothing_is_predicted_for_what_is_far_from_the_breast(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",), compressed=True)
    marks = _marked_at(tmp_path, np.array([110.0, -40.0, 0.0]))
    far = {"far": [110.0, -40.0, 0.0], "near": [*POINTS["p1"]]}
    marks["mr_landmarks"] = write_tsv(tmp_path / "far.tsv", "name x y z", far)
    found = localized(inputs | marks, tmp_path / "localize.h5")
    rows = {row["name"]: row for row in rows_of(found, "mammogram_rows")}
    assert {name: row["seen"] for name, row in rows.items()} == {
        "mass": False, "sound": True, "far": False, "near": True,
    }  # fmt: skip
    assert "67 mm from the R breast's model, towards the other breast" in rows["mass"]["message"]
    carried = {row["name"]: row for row in rows_of(found, "compressed_rows")}
    assert carried["far"]["x"] is None
    assert "67 mm from" in carried["far"]["message"]
    assert carried["near"]["x"] is not None


def test_a_lesion_that_fills_the_breast_is_refused(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    marks = _marked_at(tmp_path, np.array([0.0, -35.0, 0.0]), diameter_mm=95.0)
    rows = {r["name"]: r for r in rows_of(localized(inputs | marks, tmp_path / "l.h5"), "mammogram_rows")}
    assert not rows["mass"]["seen"]
    assert "of it), more than any lesion; mark it alone" in rows["mass"]["message"]
    assert rows["sound"]["seen"]


def test_an_unusually_large_lesion_is_flagged_and_predicted(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    marks = _marked_at(tmp_path, np.array([0.0, -35.0, 0.0]), diameter_mm=60.0)
    rows = {r["name"]: r for r in rows_of(localized(inputs | marks, tmp_path / "l.h5"), "mammogram_rows")}
    assert rows["mass"]["seen"]
    assert "unusually large" in rows["mass"]["message"]
    assert rows["sound"]["message"] == ""


def test_lesions_marked_in_the_air_of_a_mammogram() -> None:
    tissue = np.zeros((200, 100), np.uint8)
    tissue[20:150, :40] = 1
    pose: Any = SimpleNamespace(tissue=tissue, geometry=synthetic.geometry("CC"), view="CC")
    mm_px = breast_scale_mm(pose.geometry)
    areas = {
        "in": area_from_disc(20, 60, 10),
        "edge": area_from_disc(39 + 10 / mm_px, 60, 10),
        "far": area_from_disc(90, 60, 10),
        "below": area_from_disc(20, 190, 10),
        "all": LesionArea(np.ones((120, 38), bool), (1, 25)),
        "large": LesionArea(np.ones((60, 35), bool), (1, 40)),
    }
    found = strays_in_mammogram(areas, pose)
    assert {name: stray.refused for name, stray in found.items()} == {
        "edge": False, "far": 51 * mm_px > 15, "below": 41 * mm_px > 15, "all": True, "large": False,
    }  # fmt: skip
    assert "marked in the air or outside the breast, 10 mm from it in CC" in found["edge"].message
    assert "mirrored left to right it lies inside: mark it on the image as stored" in found["far"].message
    assert "turned by 180 degrees" not in found["below"].message
    assert "turned upside down it lies inside" not in found["below"].message
    assert "fills the breast (88% of it)" in found["all"].message
    assert "unusually large, 40% of the breast" in found["large"].message


def test_landmarks_in_the_air_of_a_mammogram(tmp_path: Path) -> None:
    tissue = np.zeros((200, 100), np.uint8)
    tissue[20:150, :40] = 1
    pose: Any = SimpleNamespace(
        tissue=tissue, geometry=synthetic.geometry("CC"), view="CC", has_mammogram=True, canonical_pixels=np.asarray
    )
    rows = {"in": [20, 60], "at the skin": [41, 60], "air": [80, 60], "off": [20, 230]}
    inputs = Inputs({"landmarks_CC": write_tsv(tmp_path / "p.tsv", "name column row", rows)})
    assert landmarks_in_air(inputs, pose) == ["air", "off"]


def write_mask(path: Path, size: tuple[int, int], flips: tuple[bool, bool] = (False, False)) -> Path:
    rows, columns = np.mgrid[: size[0], : size[1]]
    column, row = synthetic.stored(synthetic.true_pixel("CC", LESION), flips)
    mask = np.hypot(columns - column, rows - row) < 30
    Image.fromarray(mask.astype(np.uint8) * 255).save(path)
    return path


def test_a_mask_is_read_as_stored(tmp_path: Path) -> None:
    flips = (True, True)
    inputs = synthetic.write_case(tmp_path, views=("CC",), flips=flips)
    mask = write_mask(tmp_path / "mask.png", (synthetic.ROWS, synthetic.COLUMNS), flips)
    found = localized(inputs | {"lesion_CC": mask}, tmp_path / "localize.h5")
    curve = found.array("mr/updated/lesion0/curve_CC", "mm")
    assert np.linalg.norm(curve - LESION, axis=1).min() < 0.6
    assert [row["name"] for row in rows_of(found, "mr_rows")] == ["lesion"]


def test_a_mask_of_another_size_ends_with_a_message(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    mask = write_mask(tmp_path / "mask.png", (500, 300))
    found = localized(inputs | {"lesion_CC": mask}, tmp_path / "localize.h5")
    assert found.status == "failed"
    assert "(500, 300)" in found.message


def test_one_view_gives_curve_and_midpoint(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",)) | view_marks(tmp_path, ("CC",), (False, False))
    found = localized(inputs, tmp_path / "localize.h5")
    (row,) = rows_of(found, "mr_rows")
    assert (row["views"], row["beam_gap_mm"]) == ("CC", None)
    curve = found.array("mr/updated/lesion0/curve_CC", "mm")
    assert np.linalg.norm(curve - LESION, axis=1).min() < 0.6
    assert row["z"] == pytest.approx(0.0, abs=3.0)
    assert "does not determine the depth" in row["message"]


def test_a_view_that_failed_leaves_the_other_standing(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    for stage in ("pose", "compress", "solve"):
        inputs[stage][1] = synthetic.write_failed(tmp_path / f"{stage}_failed.h5", "R", stage, "MLO", "no breast found")
    marks = mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False))
    found = localized(inputs | marks, tmp_path / "localize.h5")
    assert found.status == "failed"
    assert "no breast found" in found.message
    rows = rows_of(found, "mammogram_rows")
    assert {row["view"]: row["seen"] for row in rows if row["name"] == "mass"} == {"CC": True, "MLO": False}
    assert "no breast found" in next(row["message"] for row in rows if row["view"] == "MLO")
    (row,) = rows_of(found, "mr_rows")
    assert row["views"] == "CC"
    assert "no breast found" in row["message"]


def test_a_compression_without_result_leaves_rigid_and_scaling(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    for stage in ("compress", "solve"):
        inputs[stage] = [synthetic.write_failed(tmp_path / f"{stage}_failed.h5", "R", stage, "CC", "diverged")]
    found = localized(inputs | mr_marks(tmp_path, "R"), tmp_path / "localize.h5")
    seen = {row["method"]: row["seen"] for row in found.value("mammogram_rows") if row["name"] == "mass"}
    assert seen == {"rigid": True, "scaling": True, "plate": False, "updated": False}


def test_a_failed_mesh_is_passed_on(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    inputs["mesh"] = [synthetic.write_failed(tmp_path / "failed.h5", "R", "mesh", message="turned inside out")]
    found = localized(inputs | mr_marks(tmp_path, "R"), tmp_path / "localize.h5")
    assert (found.status, found.message) == ("failed", "mesh: turned inside out")


@pytest.mark.parametrize("stage", ["segment", "mesh"])
def test_what_could_not_be_predicted_is_a_row_with_its_message(tmp_path: Path, stage: str) -> None:
    inputs = synthetic.write_case(tmp_path, compressed=True)
    inputs[stage] = [synthetic.write_failed(tmp_path / "failed.h5", "R", stage, message="turned inside out")]
    write_artefact(
        tmp_path / "segment_given.h5",
        synthetic.header("segment", "R") | {"inputs": '{"mr": [], "mr_compressed": []}'},
        Fields(failure=Artefact(inputs[stage][0]).failure),
    )
    inputs["segment"] = [tmp_path / "segment_given.h5"]
    for name in ("pose", "compress", "solve"):
        inputs[name] = [synthetic.write_failed(tmp_path / f"{name}.{v}.h5", "R", name, v) for v in ("CC", "MLO")]
    marks = mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False))
    found = localized(inputs | marks, tmp_path / "localize.h5")
    shown = rows_of(found, "mammogram_rows")
    assert {(r["view"], r["name"]) for r in shown} == {(v, n) for v in ("CC", "MLO") for n in ("mass", *POINTS)}
    assert all((r["seen"], r["column"], r["message"]) == (False, None, f"{stage}: turned inside out") for r in shown)
    (lesion,) = rows_of(found, "mr_rows")
    assert (lesion["views"], lesion["name"], lesion["x"]) == ("CC+MLO", "mass", None)
    assert lesion["message"] == f"{stage}: turned inside out"
    carried = rows_of(found, "compressed_rows")
    assert {r["name"]: (r["x"], r["message"]) for r in carried} == dict.fromkeys(
        POINTS, (None, f"{stage}: turned inside out")
    )


def test_a_bug_in_localize_leaves_rows_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))

    def broken(*_: Any) -> None:
        raise IndexError

    monkeypatch.setattr("stages.localize.stage.predict_in_mr", broken)
    found = localized(inputs | mr_marks(tmp_path, "R"), tmp_path / "localize.h5")
    assert found.status == "bug"
    assert {row["name"] for row in rows_of(found, "mammogram_rows")} == {"mass", *POINTS}
    assert {row["seen"] for row in rows_of(found, "mammogram_rows")} == {False}


def test_a_landmark_without_compression_has_a_message(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("3D",), compressed=True)
    for stage in ("compress", "solve"):
        inputs[stage] = [synthetic.write_failed(tmp_path / f"{stage}_failed.h5", "R", stage, "3D", "diverged")]
    found = localized(inputs | mr_marks(tmp_path, "R"), tmp_path / "localize.h5")
    rows = {row["method"]: row for row in found.value("compressed_rows") if row["name"] == "p1"}
    assert {method: row["message"] for method, row in rows.items()} == {
        "rigid": "",
        "scaling": "",
        "plate": "compress: diverged",
        "updated": "solve: diverged",
    }
    assert rows["plate"]["x"] is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name\tx\ty\n", "empty"),
        ("name\tx\ty\tdiameter_mm\na\t1\t2\t3\n", "no column z"),
        ("name\tx\ty\tz\tdiameter_mm\na\t1\t2\tthree\t4\n", "'three' is no number"),
        ("name\tx\ty\tz\tdiameter_mm\na\t1\t2\t3\t0\n", "must be positive"),
        ("name\tx\ty\tz\tdiameter_mm\na\t1\t2\t3\t4\na\t1\t2\t3\t4\n", "given twice"),
    ],
)
def test_bad_lesion_tables_end_the_case_with_a_message(tmp_path: Path, text: str, says: str) -> None:
    inputs = synthetic.write_case(tmp_path)
    (tmp_path / "bad.tsv").write_text(text)
    found = localized(inputs | {"mr_lesion": tmp_path / "bad.tsv"}, tmp_path / "localize.h5")
    assert found.status == "failed"
    assert says in found.message
    assert str(tmp_path) not in found.message
