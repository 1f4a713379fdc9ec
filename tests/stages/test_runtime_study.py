"""Study of error against computing time: what it compares and how it wires stages."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mammoreg.metrics.distances import breast_scale_mm
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.failures import Failure
from stages.engine.run import run_stage
from stages.localize.record import Predictions, mammogram_fields
from stages.studies import chain
from stages.studies.runtime import stage as runtime
from stages.studies.runtime.comparison import view_results
from tests.stages import synthetic_case as synthetic
from tests.stages.pictured_case import write_pictured_case


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Artefact]:
    folder = tmp_path_factory.mktemp("case")
    write_pictured_case(folder, "R", ("CC",))
    names = {"localize": "localize.h5", "evaluate": "evaluate.h5", "pose": "pose.CC.h5"}
    return {stage: Artefact(folder / name) for stage, name in names.items()}


def shifted(localize: Artefact, folder: Path, pixels: float) -> Artefact:
    """The same predictions, so many pixels further along the columns."""
    rows = [replace(row, column=row.column + pixels) for row in Predictions(localize).mammogram_rows]
    path = folder / "localize.h5"
    write_artefact(path, synthetic.header("localize", "R"), mammogram_fields(rows, [], []))
    return Artefact(path)


def test_the_finest_mesh_has_no_discretisation_error(opened: dict[str, Artefact]) -> None:
    results = view_results("CC", opened, opened)
    assert set(results) == {"rigid", "scaling", "plate", "updated"}
    assert all(discretisation == 0.0 for _, discretisation in results.values())
    error, _ = results["updated"]
    assert error is not None
    assert error < 0.1


def test_discretisation_is_a_distance_at_the_middle_of_the_plates(opened: dict[str, Artefact], tmp_path: Path) -> None:
    coarse = opened | {"localize": shifted(opened["localize"], tmp_path, 8.0)}
    _, discretisation = view_results("CC", coarse, opened)["plate"]
    assert discretisation == pytest.approx(8.0 * breast_scale_mm(synthetic.geometry("CC")))


def test_a_failed_pose_gives_no_result(opened: dict[str, Artefact], tmp_path: Path) -> None:
    failed = Artefact(synthetic.write_failed(tmp_path / "pose.CC.h5", "R", "pose", "CC"))
    assert view_results("CC", opened | {"pose": failed}, opened) == {}


def fake_run_stage(calls: list[tuple[str, Any]]) -> Any:
    """Writes artefacts without results, and notes what each stage was given."""

    def run(name: str, inputs: dict[str, Any], output: Path, settings: dict[str, Any], subject: Subject) -> None:
        calls.append((name, (inputs, settings, subject)))
        header = synthetic.header(name, subject.laterality, subject.view or "")
        write_artefact(output, header, Fields(failure=Failure(name, subject.view or "", "failed", "not run")))

    return run


def test_stages_get_the_main_run_s_settings_rows_and_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[str, Any]] = []
    monkeypatch.setattr(chain, "run_stage", fake_run_stage(calls))
    plan = chain.Plan(
        Subject("case1", "L"),
        {"segment": [tmp_path / "s.h5"], "image_CC": [tmp_path / "cc.dcm"], "image_MLO": [tmp_path / "mlo.dcm"]},
        {"mesh": {"elements": 7, "max_volume_error": 0.1}},
        {"CC": {"thickness_mm": "60"}, "MLO": {}},
    )
    done = runtime._run_mesh(plan, 5, tmp_path / "5")
    given = {(name, call[2].view): call for name, call in calls}
    assert given["mesh", None][1] == {"elements": 5, "max_volume_error": 0.1}
    assert given["pose", "CC"][0]["image"] == [tmp_path / "cc.dcm"]
    assert given["pose", "MLO"][0]["image"] == [tmp_path / "mlo.dcm"]
    assert given["pose", "CC"][2] == Subject("case1", "L", "CC", {"thickness_mm": "60"})
    assert given["solve", "MLO"][0]["mesh"] == [tmp_path / "5" / "mesh.h5"]
    assert given["solve", "MLO"][0]["compress"] == [tmp_path / "5" / "compress.MLO.h5"]
    assert given["localize", None][0]["pose"] == [tmp_path / "5" / f"pose.{view}.h5" for view in ("CC", "MLO")]
    assert done.peak_mb > 10
    rows = runtime._rows(plan, done, done)
    assert len(rows) == 8
    assert all(row["failed"] and row["error_mm"] is None for row in rows)


def test_table_and_picture_of_the_cohort(tmp_path: Path) -> None:
    rows = [
        {"view": "CC", "method": method, "material": "homogeneous neo-Hookean", "elements": n, "failed": False}
        | {"error_mm": 20.0 / n, "discretisation_mm": 10.0 / n - 1.0, "solve_s": n / 2, "total_s": n, "peak_mb": 300.0}
        for method in ("plate", "updated")
        for n in (5, 7, 10)
    ]
    rows.append({**rows[0], "method": "rigid", "error_mm": None, "discretisation_mm": None, "failed": True})
    write_artefact(tmp_path / "runtime.h5", synthetic.header("runtime", "R"), Fields(values={"rows": rows}))
    given = {"runtime": [tmp_path / "runtime.h5"]}
    run_stage("error_vs_runtime", given, tmp_path / "error_vs_runtime.h5", {}, Subject("cohort"))
    with (tmp_path / "tables" / "error_vs_runtime.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    columns = "case,view,method,material,elements,error_mm,discretisation_mm,solve_s,total_s,peak_mb,failed"
    assert list(table[0]) == columns.split(",")
    assert table[0]["error_mm"] == "4.000"
    assert (table[-1]["error_mm"], table[-1]["failed"]) == ("", "true")
    assert (tmp_path / "figures" / "error_vs_runtime.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(json.dumps(Artefact(tmp_path / "error_vs_runtime.h5").value("rows")))[0]["case"] == "case1"
    assert np.isfinite([float(row["total_s"]) for row in table]).all()
