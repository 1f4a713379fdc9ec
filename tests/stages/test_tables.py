"""Stage `tables`: what a cohort's files say, from rows with known statistics."""

import csv
import io
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from mammoreg.metrics.findings import judged, numbers_of
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.failures import Failure
from stages.engine.run import run_stage
from stages.tables.findings import CLAIMS
from stages.tables.statistics import PRINTED

FORMS = ("csv", "md", "html")
NAMES = (
    *("predictions_mammogram", "predictions_mr", "predictions_compressed", "views", "segmentation"),
    *("table_5_mammogram", "table_6_mr", "elongation", "landmarks"),
)


def write(folder: Path, stage: str, case: str, values: dict[str, Any], failure: Failure | None = None) -> Path:
    header = {"stage": stage, "case": case, "view": "", "laterality": "R", "artefact_id": f"{case}{stage}"}
    path = folder / f"{case}.{stage}.h5"
    folder.mkdir(exist_ok=True)
    write_artefact(path, header, Fields(values=values, failure=failure))
    return path


def lesion_row(view: str, method: str, distance: float | None, overlap: float | None = 50.0) -> dict[str, Any]:
    numbers = {"distance_mm": distance, "overlap_percent": overlap, "dice": 0.5, "size_ratio": 1.0}
    return {"view": view, "method": method, "name": "lesion", **numbers}


def mr_row(views: str, method: str, distance: float | None) -> dict[str, Any]:
    row = lesion_row(views, method, distance) | {"views": views, "distance_to_curve_mm": None}
    del row["view"]
    return row


def write_cohort(folder: Path) -> dict[str, list[Path]]:
    """One case that went well and one that failed."""
    good = {
        "table_5_rows": [
            *(lesion_row("CC", method, d) for method, d in (("rigid", 10.0), ("updated", 2.0))),
            *(lesion_row("MLO", method, d) for method, d in (("rigid", 8.0), ("updated", 4.0))),
        ],
        "table_6_rows": [mr_row("CC+MLO", "rigid", 20.0), mr_row("CC+MLO", "updated", 5.0)],
        "landmark_rows": [{"view": "3D", "method": "plate", "landmark": "p1", "distance_mm": 3.25}],
        "view_rows": [{"view": "CC", "method": "updated", "angle_deg": -0.001, "force_n": 88.88, "trust": "a, b"}],
        "elongation_rows": [],
    }
    bad = {
        "table_5_rows": [lesion_row("CC", method, None, None) for method in ("rigid", "updated")],
        "table_6_rows": [mr_row("CC", "updated", 30.0)],
        "landmark_rows": [],
        "view_rows": [],
        "elongation_rows": [],
    }
    seen = {"view": "CC", "method": "updated", "name": "lesion", "column": 10.126, "row": 7.0, "seen": True}
    unseen = seen | {"column": None, "row": None, "seen": False, "message": "outside the imaged part"}
    predicted = {"mammogram_rows": [seen | {"message": ""}, unseen | {"view": "MLO"}], "mr_rows": []}
    failure = Failure("mesh", "", "failed", "turned inside out")
    check = {"check": "gland_share", "value": 0.70009, "low": 0.02, "high": 0.6, "unit": "1", "doubt": "too much"}
    return {
        "segment": [write(folder, "segment", "good", {"checks": [check]})],
        "mesh": [write(folder, "mesh", "good", {}), write(folder, "mesh", "bad", {}, failure)],
        "localize": [write(folder, "localize", "good", predicted), write(folder, "localize", "bad", {}, failure)],
        "evaluate": [write(folder, "evaluate", "good", good), write(folder, "evaluate", "bad", bad, failure)],
    }


def tabulated(folder: Path, inputs: dict[str, list[Path]]) -> Path:
    run_stage("tables", inputs, folder / "tables.h5", {}, Subject("cohort"))
    return folder / "tables"


def read(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text())))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("cohort")
    return tabulated(place, write_cohort(place))


def test_every_table_in_every_form(folder: Path) -> None:
    found = {path.name for path in folder.iterdir()}
    assert found == {f"{name}.{form}" for name in NAMES for form in FORMS} | {
        *("cohort.nc", "summary.csv", "findings.csv", "failures.csv")
    }


COLUMNS = """
predictions_mammogram case,view,method,name,column,row,radius_mm,seen,message
predictions_mr case,views,method,name,x,y,z,radius_mm,beam_gap_mm,nipple_distance_mm,clock,skin_depth_mm,\
chest_wall_depth_mm,message
predictions_compressed case,method,name,x,y,z,message
views case,view,method,angle_deg,edge_p_mm,middle_mm,height_mm,thickness_mm,force_n,outline_mean_mm,\
outline_p95_mm,outline_dice,ncc,outline_step,penetration_mm,folded_corners,estimated,trust
segmentation case,check,value,low,high,unit,doubt
table_5_mammogram case,view,method,name,distance_mm,overlap_percent,dice,size_ratio
table_6_mr case,views,method,name,distance_mm,overlap_percent,dice,size_ratio,distance_to_curve_mm
elongation case,view,method,direction,elongation_mm,true_mm
landmarks case,view,method,landmark,distance_mm
"""


@pytest.mark.parametrize("line", COLUMNS.split("\n")[1:-1])
def test_columns_are_the_contracts(folder: Path, line: str) -> None:
    name, columns = line.split()
    assert (folder / f"{name}.csv").read_text().splitlines()[0] == columns


def test_predictions_have_fixed_decimals_and_no_number_where_unseen(folder: Path) -> None:
    lines = (folder / "predictions_mammogram.csv").read_text().splitlines()
    assert lines[1] == "good,CC,updated,lesion,10.13,7.00,,true,"
    assert lines[2] == "good,MLO,updated,lesion,,,,false,outside the imaged part"


def test_a_segmentation_stands_beside_what_is_usual(folder: Path) -> None:
    lines = (folder / "segmentation.csv").read_text().splitlines()
    assert lines[1:] == ["good,gland_share,0.700,0.020,0.600,1,too much"]


def test_texts_with_commas_are_quoted_and_no_negative_zero(folder: Path) -> None:
    assert '"a, b"' in (folder / "views.csv").read_text()
    (row,) = read(folder / "views.csv")
    assert (row["angle_deg"], row["force_n"], row["trust"]) == ("0.00", "88.9", "a, b")


def test_statistics_count_the_failed_case(folder: Path) -> None:
    rows = {(row["group"], row["method"]): row for row in read(folder / "summary.csv")}
    updated = rows["lesions in the mammograms", "updated"]
    assert (updated["n"], updated["of"], updated["mean_mm"], updated["sd_mm"]) == ("2", "3", "3.00", "1.00")
    assert (updated["median_mm"], updated["max_mm"], updated["within_5_mm_percent"]) == ("3.00", "4.00", "100.0")
    assert updated["improvement_percent"] == "65.0"
    assert (updated["reduction_percent"], updated["compared"]) == ("66.7", "2")
    assert (updated["paper_mean_mm"], updated["paper_sd_mm"], updated["paper_improvement_percent"]) == (
        "4.30",
        "1.03",
        "78.0",
    )
    two_views = rows["lesions in the MR volumes, from two views", "updated"]
    assert (two_views["n"], two_views["mean_mm"], two_views["improvement_percent"]) == ("1", "5.00", "75.0")
    assert rows["lesions in the MR volumes, from one view", "updated"]["mean_mm"] == "30.00"
    assert rows["landmarks in the compressed volume", "plate"]["paper_mean_mm"] == "3.10"


def test_readable_tables_say_first_what_is_missing(folder: Path) -> None:
    text = (folder / "table_5_mammogram.md").read_text()
    first = text.splitlines()[2:6]
    assert first[0] == "**bad failed: mesh: turned inside out**"
    assert first[2] == "**rigid: 2 of 3 lesions in the mammograms have a prediction**"
    assert text.count("turned inside out") == 1
    header, cells = (
        [cell.strip() for cell in next(line for line in text.splitlines() if start in line).split("|")]
        for start in ("| method", "| updated")
    )
    assert cells[1:7] == ["updated", "2 of 3", "3.00 (1.00)", "3.00", "4.00", "100.0"]
    assert header[7:9] == [
        "improvement over rigid, mean of ratios (the paper's), %",
        "mean below that of rigid (ours), %",
    ]
    assert cells[7:9] == ["65.0", "66.7 (2 of 3)"]
    assert cells[10:12] == ["11 of 11", "4.30 (1.03)"]
    page = (folder / "table_5_mammogram.html").read_text()
    assert page.index("turned inside out") < page.index("2 of 3") < page.index("<table>")


def test_netcdf_is_selected_by_approach(folder: Path) -> None:
    """`method` is a keyword of xarray's `sel`, which would ignore a dimension of that name without a word."""
    with xr.open_dataset(folder / "cohort.nc") as data:
        assert set(data.sizes) == {"case", "view", "approach", "mark", "check"}
        lesion = data.lesion_mammogram_distance_mm.sel(mark="lesion")
        assert float(lesion.sel(approach="updated").mean()) == 3.0
        assert float(lesion.sel(approach="rigid").mean()) == 9.0
        assert float(lesion.sel(case="good", view="MLO", approach="updated")) == 4.0
        assert lesion.units == "mm"
        assert float(data.view_force_n.sel(case="good", view="CC", approach="updated")) == pytest.approx(88.88)
        two_views = data.lesion_mr_distance_mm.sel(case="good", view="CC+MLO", approach="rigid", mark="lesion")
        assert float(two_views) == 20.0
        seen = data.predicted_mammogram_seen.sel(case="good", approach="updated", mark="lesion")
        assert [float(seen.sel(view=view)) for view in ("CC", "MLO")] == [1.0, 0.0]


def test_netcdf_holds_failed_cases(folder: Path, tmp_path: Path) -> None:
    with xr.open_dataset(folder / "cohort.nc") as data:
        assert data.lesion_mammogram_distance_mm.sel(case="bad", view="CC", approach="updated", mark="lesion").isnull()
        assert data.status.sel(case=["good", "bad"]).values.tolist() == ["ok", "failed"]
        assert data.message.sel(case="bad").item() == "mesh: turned inside out"
    failed = {"mesh": [write(tmp_path, "mesh", "only", {}, Failure("mesh", "", "bug", "stopped by a bug"))]}
    with xr.open_dataset(tabulated(tmp_path, failed) / "cohort.nc") as data:
        assert data.case.values.tolist() == ["only"]
        assert data.status.values.tolist() == ["bug"]


def test_netcdf_is_the_fourth(folder: Path) -> None:
    assert (folder / "cohort.nc").read_bytes().startswith(b"\x89HDF")


def test_failures_name_each_stage_that_failed_first(folder: Path, tmp_path: Path) -> None:
    assert read(folder / "failures.csv") == [
        {"case": "bad", "view": "", "stage": "mesh", "status": "failed", "message": "turned inside out"}
    ]
    first = Failure("pose", "CC", "not_converged", "no angle: none, of all")
    other = Failure("compress", "MLO", "bug", "stopped by a bug")
    inputs = {
        "pose": [write(tmp_path, "pose", "a", {}, first)],
        "solve": [write(tmp_path / "CC", "solve", "a", {}, first), write(tmp_path / "MLO", "solve", "a", {}, other)],
        "figures": [write(tmp_path, "figures", "b", {}, Failure("figures", "", "bug", "stopped by a bug"))],
    }
    rows = [tuple(row.values()) for row in read(tabulated(tmp_path, inputs) / "failures.csv")]
    assert rows == [
        ("a", "CC", "pose", "not_converged", "no angle: none, of all"),
        ("a", "MLO", "compress", "bug", "stopped by a bug"),
        ("b", "", "figures", "bug", "stopped by a bug"),
    ]


def test_findings_judge_the_paper_by_these_tables(folder: Path) -> None:
    """Mammograms: rigid 9, updated 3 mm, of 3; improvement 65 %, below the paper's 78."""
    found = {(row["table"], row["statement"]): row for row in read(folder / "findings.csv")}
    kept = found["table_5", "updated boundary conditions keep the mean within 5 mm"]
    assert (kept["case"], kept["held"], kept["paper"], kept["here"]) == ("cohort", "true", "4.3 mm", "3.0 mm (2 of 3)")
    missed = found[
        "table_5", "updated boundary conditions improve on rigid alignment by 78 % and more (mean of ratios)"
    ]
    assert (missed["held"], missed["paper"], missed["here"]) == ("false", "78 %", "65 % (2 of 3)")
    unknown = found["table_5", "plate compression places lesions nearer than rigid alignment"]
    assert (unknown["held"], unknown["here"]) == ("", "")
    largest = found["table_5 and table_6", "no lesion's place is off by more than 6.2 mm"]
    assert (largest["held"], largest["paper"], largest["here"]) == ("true", "6.2 mm", "5.0 mm (2 of 3)")


def test_the_paper_s_own_numbers_hold_its_statements() -> None:
    paper: dict[str, float] = {}
    for table, printed in PRINTED.items():
        paper |= numbers_of({f"{table} {method}": summary for method, (summary, _) in printed.items()})
    for claims in CLAIMS.values():
        assert [finding.held for finding in judged(claims, paper, paper)] == [True] * len(claims)


def test_a_rerun_is_identical(folder: Path, tmp_path: Path) -> None:
    again = tabulated(tmp_path, write_cohort(tmp_path))
    for path in folder.iterdir():
        assert (again / path.name).read_bytes() == path.read_bytes(), path.name


def test_a_cohort_without_any_view_still_has_its_tables(tmp_path: Path) -> None:
    inputs = {
        "mesh": [
            write(tmp_path, "mesh", "a", {}),
            write(tmp_path, "mesh", "b", {}, Failure("mesh", "", "failed", "no breast")),
        ]
    }
    found = tabulated(tmp_path, inputs)
    assert read(found / "table_6_mr.csv") == []
    assert "no breast" in (found / "views.md").read_text()
    assert Artefact(tmp_path / "tables.h5").ok


def test_html_escapes_what_users_write(tmp_path: Path) -> None:
    row = {"view": "CC", "method": "plate", "name": "<b>&", "column": 1.0, "row": 2.0, "seen": True, "message": ""}
    inputs = {"localize": [write(tmp_path, "localize", "a", {"mammogram_rows": [row]})]}
    page = (tabulated(tmp_path, inputs) / "predictions_mammogram.html").read_text()
    assert "&lt;b&gt;&amp;" in page
    assert "<b>&" not in page
