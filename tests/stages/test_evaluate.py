"""Stage `evaluate`: what it measures where the predictions' error is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mammoreg.geometry import breast_to_lps, plate_to_breast
from stages.engine.artefact import Artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from tests.stages import synthetic_case as synthetic
from tests.stages.test_localize import LESION, POINTS, localized, mr_marks, view_marks, write_mask, write_tsv

OFFSET_PX = np.array([12.0, 16.0])  # 20 pixels of 0.25 mm: 5 mm at the detector


def evaluated(
    folder: Path, inputs: dict[str, Any], settings: dict[str, Any] | None = None, row: dict[str, str] | None = None
) -> Artefact:
    known = {name: paths for name, paths in inputs.items() if name in ("segment", "mesh", "pose", "compress", "solve")}
    localize_marks = {n: p for n, p in inputs.items() if n.startswith(("mr_l", "lesion"))}
    localized(known | localize_marks, folder / "localize.h5")
    everything = inputs | {"localize": folder / "localize.h5"}
    run_stage("evaluate", everything, folder / "evaluate.h5", settings or {}, Subject("case1", row=row or {}))
    return Artefact(folder / "evaluate.h5")


def landmark_truth(folder: Path) -> dict[str, Path]:
    named = {name: point for name, point in POINTS.items() if name != "deep"}
    found = {}
    for view in ("CC", "MLO"):
        pixels = {name: synthetic.true_pixel(view, point) + OFFSET_PX for name, point in named.items()}
        pixels |= {"only_here": np.array([100.0, 100.0]), "deep": np.array([3.0, 300.0])}
        found[f"landmarks_{view}"] = write_tsv(folder / f"landmarks_{view}.tsv", "name column row", pixels)
    carried = {
        name: plate_to_breast(synthetic.compression("CC").forward(point[None])[0], 3.0)
        + synthetic.SECOND_VOLUME_SHIFT
        + np.array([0.0, 2.0, 0.0])
        for name, point in named.items()
    }
    found["mr_compressed_landmarks"] = write_tsv(folder / "compressed.tsv", "name x y z", carried)
    return found


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Artefact:
    folder = tmp_path_factory.mktemp("evaluate")
    inputs = synthetic.write_case(folder, compressed=True)
    marks = mr_marks(folder, "R") | view_marks(folder, ("CC", "MLO"), (False, False)) | landmark_truth(folder)
    return evaluated(folder, inputs | marks)


def rows_of(artefact: Artefact, name: str, method: str) -> list[dict[str, Any]]:
    return [row for row in artefact.value(name) if row["method"] == method]


def test_perfect_predictions_of_the_lesion(result: Artefact) -> None:
    for row in rows_of(result, "table_5_rows", "updated"):
        assert row["distance_mm"] < 0.2
        assert row["overlap_percent"] > 90.0
    (row,) = rows_of(result, "table_6_rows", "updated")
    assert row["views"] == "CC+MLO"
    assert row["distance_mm"] < 0.6
    assert row["overlap_percent"] > 90.0
    assert row["distance_to_curve_mm"] is None


def test_known_offset_of_landmarks_and_what_counts(result: Artefact) -> None:
    expected = 20 * synthetic.PIXEL_MM / synthetic.geometry("CC").middle_magnification
    for view in ("CC", "MLO"):
        rows = {
            r["landmark"]: r["distance_mm"] for r in rows_of(result, "landmark_rows", "updated") if r["view"] == view
        }
        assert set(rows) == {"p1", "p2", "deep"}
        assert rows["deep"] is None
        assert rows["p1"] == pytest.approx(expected, rel=1e-6)


def test_landmarks_in_the_second_volume(result: Artefact) -> None:
    rows = [row for row in rows_of(result, "landmark_rows", "plate") if row["view"] == "3D"]
    assert {row["landmark"] for row in rows} == {"p1", "p2"}
    assert all(row["distance_mm"] == pytest.approx(2.0, abs=0.7) for row in rows)
    before = {m: [r["distance_mm"] for r in rows_of(result, "landmark_rows", m)] for m in ("before", "translation")}
    assert np.mean(before["translation"]) < np.mean(before["before"])


def test_fit_of_a_view_that_meets_its_outline(result: Artefact) -> None:
    row = next(row for row in rows_of(result, "view_rows", "updated") if row["view"] == "CC")
    assert row["outline_mean_mm"] < 0.3
    assert row["outline_dice"] > 0.99
    assert (row["force_n"], row["angle_deg"], row["middle_mm"], row["trust"]) == (80.0, 3.0, 2.0, "")


def test_a_left_breast_counts_the_middle_the_other_way(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, "L", views=("CC",))
    assert evaluated(tmp_path, inputs).value("view_rows")[0]["middle_mm"] == -2.0


def test_what_speaks_against_a_view(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    found = evaluated(tmp_path, inputs, {"min_det_f_limit": 0.95, "outline_p95_limit_mm": 2.0})
    trust = rows_of(found, "view_rows", "plate")[0]["trust"]
    assert trust == "low Jacobian 0.90"
    assert "outline misfit" in rows_of(found, "view_rows", "rigid")[0]["trust"]


def test_doubts_of_the_segmentation_count_for_every_view_and_method(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    synthetic.write_segment(inputs["segment"][0], "R", warnings=("share of gland is 0.9",))
    rows = evaluated(tmp_path, inputs).value("view_rows")
    assert {row["view"] for row in rows} == {"CC", "MLO"}
    assert all(row["trust"].endswith("share of gland is 0.9") for row in rows)


def test_doubts_of_the_pose_stand_before_every_method_s_own(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    doubts = {"CC": ["angle not determined by the image", "polarity assumed"], "MLO": []}
    for path, (view, flags) in zip(inputs["pose"], doubts.items(), strict=True):
        synthetic.write_pose(path, "R", view, (False, False), outlined=True, flags=flags)
    rows = evaluated(tmp_path, inputs, {"min_det_f_limit": 0.95}).value("view_rows")
    assert {row["method"] for row in rows} == {"rigid", "scaling", "plate", "updated"}
    for row in rows:
        own = ["low Jacobian 0.90"] if row["method"] in ("plate", "updated") else []
        told = [text for text in row["trust"].split("; ") if text and "outline misfit" not in text]
        assert told == [*doubts[row["view"]], *own]


@pytest.mark.parametrize(
    ("values", "doubt"),
    [
        ({"penetration_mm": 3.9}, ""),
        ({"penetration_mm": 4.1}, "skin or back 4.1 mm inside a plate"),
        ({"folded_corners": 9, "folded_share": 0.02}, ""),
        ({"folded_corners": 40, "folded_share": 0.06}, "40 folded corners in 6% of the elements"),
        ({"contact_lost": True, "force_lower_n": 160.0, "force_upper_n": 0.0}, "contact with the upper plate lost"),
        ({"sideways_drift_mm": -4.7}, ""),
        ({"sideways_drift_mm": -4.9}, "breast tipped sideways by 4.9 mm"),
    ],
)
def test_what_speaks_against_a_breast_between_plates(tmp_path: Path, values: dict[str, Any], doubt: str) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    for stage in ("compress", "solve"):
        synthetic.write_solution(inputs[stage][0], "R", stage, "CC", {"thickness_mm": 80.0, **values})
    found = evaluated(tmp_path, inputs)
    for method in ("plate", "updated"):
        trust = rows_of(found, "view_rows", method)[0]["trust"]
        assert trust.startswith(doubt) if doubt else trust == ""
    assert rows_of(found, "view_rows", "rigid")[0]["trust"].find("plate") < 0


def test_views_that_are_all_of_another_size_are_flagged_together(tmp_path: Path) -> None:
    """One view alone may be off by as much."""
    inputs = synthetic.write_case(tmp_path)
    for size, doubted in ((1.03, False), (1.15, True)):
        for view, path in zip(("CC", "MLO"), inputs["pose"], strict=True):
            values = {"relative_size": size if view == "MLO" else 1.06}
            synthetic.write_pose(path, "R", view, (False, False), True, values=values)
        rows = evaluated(tmp_path, inputs).value("view_rows")
        text = "all mammograms show a breast 9% smaller than the MR volume's between plates: check their pixel spacing"
        assert {(text in row["trust"]) for row in rows} == {doubted}


def test_elongation_is_the_closed_form(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("3D",), compressed=True)
    stretch = synthetic.SHRINK**-0.5 - 1.0
    rows = {r["direction"]: r for r in rows_of(evaluated(tmp_path, inputs), "elongation_rows", "updated")}
    width = 2 * synthetic.HALF_WIDTH * (np.cos(np.radians(3)) + np.sin(np.radians(3)))
    for direction, expected in {"antero_posterior": stretch * synthetic.DEPTH, "lateral": stretch * width}.items():
        assert rows[direction]["elongation_mm"] == pytest.approx(expected, abs=0.5)
        assert rows[direction]["true_mm"] == pytest.approx(expected, abs=0.5)


def test_plates_without_any_image_have_no_fit(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("3D",), outlined=False)
    found = evaluated(tmp_path, inputs)
    assert found.ok
    assert found.value("elongation_rows") == []
    row = rows_of(found, "view_rows", "plate")[0]
    assert (row["outline_mean_mm"], row["outline_dice"], row["force_n"]) == (None, None, 80.0)


def test_a_failed_case_counts_with_empty_distances(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    inputs["segment"] = [synthetic.write_failed(tmp_path / "bad.h5", "R", "segment", message="volume is NaN")]
    marks = mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False)) | landmark_truth(tmp_path)
    found = evaluated(tmp_path, inputs | marks)
    assert (found.status, found.message) == ("failed", "segment: volume is NaN")
    assert [row["distance_mm"] for row in rows_of(found, "table_5_rows", "updated")] == [None, None]
    assert [row["views"] for row in rows_of(found, "table_6_rows", "updated")] == ["CC+MLO"]
    assert all(row["distance_mm"] is None for row in rows_of(found, "landmark_rows", "updated"))
    assert found.value("view_rows") == []


def test_a_bug_leaves_rows_with_empty_distances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inputs = synthetic.write_case(tmp_path)
    marks = mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False)) | landmark_truth(tmp_path)

    def broken(*_: Any) -> None:
        raise IndexError

    monkeypatch.setattr("stages.evaluate.stage.fit_rows", broken)
    found = evaluated(tmp_path, inputs | marks)
    assert found.failure is not None
    assert (found.failure.stage, found.status) == ("evaluate", "bug")
    assert [row["distance_mm"] for row in rows_of(found, "table_5_rows", "updated")] == [None, None]
    assert [row["distance_mm"] for row in rows_of(found, "table_6_rows", "plate")] == [None]
    assert {row["landmark"] for row in rows_of(found, "landmark_rows", "updated")} == {"p1", "p2", "deep"}


def test_a_mask_of_another_size_is_told_once(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",)) | mr_marks(tmp_path, "R")
    table = write_tsv(
        tmp_path / "lesion.tsv", "name x y z diameter_mm", {"lesion": [*breast_to_lps(LESION, "R"), 10.0]}
    )
    mask = write_mask(tmp_path / "mask.png", (500, 300))
    found = evaluated(tmp_path, inputs | {"mr_lesion": table, "lesion_CC": mask})
    assert found.failure is not None
    assert found.failure.stage == "localize"
    assert [row["distance_mm"] for row in rows_of(found, "table_5_rows", "updated")] == [None]


def test_columns_of_the_solution_and_of_what_was_estimated(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    solved = {"force_lower_n": 60.0, "force_upper_n": 64.0, "penetration_mm": 1.25, "folded_corners": 3}
    synthetic.write_solution(inputs["solve"][0], "R", "solve", "CC", solved | {"folded_share": 0.01})
    rows = {row["method"]: row for row in evaluated(tmp_path, inputs).value("view_rows")}
    names = ("force_n", "penetration_mm", "folded_corners", "outline_step", "estimated")
    assert [rows["updated"][name] for name in names] == [62.0, 1.25, 3.0, None, "source_detector_mm"]
    assert [rows["rigid"][name] for name in names] == [None, None, None, None, "source_detector_mm"]


@pytest.mark.parametrize(
    ("views", "told", "trust"),
    [
        (("CC",), "0.30", "compression 30 % in the cases table, 40 % in the mammogram"),
        (("CC",), "0.38", ""),
        (("CC",), "", ""),
        (("3D",), "0.50", "compression 50 % in the cases table, 40 % in the second volume"),
    ],
)
def test_another_compression_than_the_table_s_warns(tmp_path: Path, views: tuple[str], told: str, trust: str) -> None:
    inputs = synthetic.write_case(tmp_path, views=views, compressed=views == ("3D",))
    synthetic.write_solution(inputs["compress"][0], "R", "compress", views[0], {"compression": 0.4})
    found = evaluated(tmp_path, inputs, row={"compression": told} if told else {})
    assert {row["trust"] for row in found.value("view_rows") if row["method"] in ("plate", "updated")} == {trust}


def test_a_compression_without_any_image_has_nothing_to_differ_from(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("3D",), outlined=False)
    found = evaluated(tmp_path, inputs, row={"compression": "0.9"})
    assert {row["trust"] for row in found.value("view_rows")} == {""}


def test_one_view_measures_the_distance_to_its_curve(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path, views=("CC",))
    found = evaluated(tmp_path, inputs | mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC",), (False, False)))
    (row,) = rows_of(found, "table_6_rows", "updated")
    assert row["views"] == "CC"
    assert row["distance_to_curve_mm"] < 0.6
    assert row["distance_mm"] == pytest.approx(abs(LESION[2]), abs=3.0)


def test_a_lost_view_leaves_an_empty_two_view_row(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    for stage in ("compress", "solve"):
        inputs[stage][1] = synthetic.write_failed(tmp_path / f"{stage}_bad.h5", "R", stage, "MLO")
    found = evaluated(tmp_path, inputs | mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False)))
    rows = {row["views"]: row["distance_mm"] for row in rows_of(found, "table_6_rows", "plate")}
    assert rows["CC+MLO"] is None
    assert rows["CC"] is not None


def test_names_must_agree_to_be_compared(tmp_path: Path) -> None:
    inputs = synthetic.write_case(tmp_path)
    other = write_tsv(tmp_path / "o.tsv", "name x y z diameter_mm", {"other": [*breast_to_lps(LESION, "R"), 8.0]})
    found = evaluated(tmp_path, inputs | view_marks(tmp_path, ("CC", "MLO"), (False, False)) | {"mr_lesion": other})
    assert found.value("table_5_rows") == found.value("table_6_rows") == []
