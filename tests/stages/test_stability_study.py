"""The stability study: batches, isolation, what the table and the page say."""

import csv
import os
import time
from pathlib import Path
from typing import Any

import pytest

from mammoreg.errors import NotConvergedError
from mammoreg.scenes.design import stability_design
from mammoreg.scenes.scenario import SCAN
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.failures import Failure
from stages.engine.run import run_stage
from stages.studies.stability import scan_mesh as stability_scan_mesh
from stages.studies.stability.batch import NO_SCAN, NOT_CHOSEN, batch_of
from stages.studies.stability.isolated import in_own_process
from stages.studies.stability.stage import COLUMNS
from stages.studies.stability.summary import summary, with_mesh_trend
from tests.shared_data import DATA, requires_shared
from tests.stages import synthetic_case as synthetic


def row(name: str, **values: Any) -> dict[str, Any]:
    """A row of a converged scenario that passes its checks."""
    standard = {
        "scenario": name,
        "material": "linear",
        "nu": 0.49,
        "compression": 0.5,
        "elements": 5,
        "contrast": 1,
        "shape": "flat",
        "friction": "0",
        "converged": True,
        "checks_passed": True,
        "newton_iterations": 50,
        "load_steps": 8,
        "min_jacobian": 0.2,
        "volume_change": -1e-3,
        "force_n": 10.0,
        "width_mm": 150.0,
        "depth_mm": 60.0,
        "penetration_mm": 0.4,
        "wall_s": 1.0,
        "message": "",
        "checks": [{"name": "unbalanced force", "value": 1e-6, "limit": 1e-3}],
    }
    return standard | values


def test_batches_hold_every_scenario_once() -> None:
    names = [scenario.name for k in range(7) for scenario in batch_of(k, 7)]
    assert sorted(names) == sorted(scenario.name for scenario in stability_design())
    finest = [sum(scenario.elements == 14 for scenario in batch_of(k, 7)) for k in range(7)]
    assert max(finest) - min(finest) <= 1


def test_a_process_of_its_own_ends_no_other() -> None:
    assert in_own_process(lambda: 7, 10.0) == 7
    with pytest.raises(NotConvergedError, match=r"limit of 0\.2 s"):
        in_own_process(lambda: time.sleep(20.0), 0.2)
    with pytest.raises(NotConvergedError, match="died"):
        in_own_process(lambda: os._exit(3), 10.0)
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        in_own_process(lambda: 1 // 0, 10.0)


def run_batch(folder: Path, settings: dict[str, Any], **inputs: Path) -> dict[str, dict[str, Any]]:
    subject = Subject("cohort", row={"batch": "0"})
    run_stage("stability_batch", inputs, folder / "stability_batch.0.h5", {"batches": 1} | settings, subject)
    return {r["scenario"]: r for r in Artefact(folder / "stability_batch.0.h5").value("rows")}


def test_table_lists_every_scenario_whether_run_or_not(tmp_path: Path) -> None:
    rows = run_batch(tmp_path, {"only": ["mesh-01-5", "scan-01"]})
    assert rows["mesh-01-5"]["converged"] is not None
    assert rows["scan-01"]["message"] == NO_SCAN
    assert rows["corner-01-worst"]["message"] == NOT_CHOSEN
    batch = tmp_path / "stability_batch.0.h5"
    run_stage("stability", {"stability_batch": [batch]}, tmp_path / "stability.h5", {}, Subject("cohort"))
    with (tmp_path / "tables/stability.csv").open() as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    assert [r["scenario"] for r in table] == sorted(s.name for s in stability_design())
    assert {r["converged"] for r in table if r["shape"] == SCAN} == {""}
    page = (tmp_path / "tables/stability.html").read_text()
    assert "did not run" in page
    assert "figures/stability.png" in page
    assert (tmp_path / "figures/stability.png").stat().st_size > 10_000


def test_a_scan_that_fails_is_told_in_its_rows(tmp_path: Path) -> None:
    broken = synthetic.header("stability_scan_mesh", "R")
    write_artefact(
        tmp_path / "scan.h5", broken, Fields(failure=Failure("stability_scan_mesh", "", "failed", "no breast found"))
    )
    rows = run_batch(tmp_path, {"only": ["scan-01"]}, stability_scan_mesh=tmp_path / "scan.h5")
    assert rows["scan-01"]["converged"] is None
    assert rows["scan-01"]["message"] == "not run: no breast found"


def test_unknown_names_are_an_error(tmp_path: Path) -> None:
    subject = Subject("cohort", row={"batch": "0"})
    fields = run_stage("stability_batch", {}, tmp_path / "b.h5", {"only": ["corner-99"]}, subject)
    assert fields.status == "failed"
    assert "corner-99" in fields.message


def test_page_says_that_a_limit_was_moved_and_what_it_would_have_cost() -> None:
    said = "\n".join(summary([row("fine"), row("deep", penetration_mm=2.4)])[0])
    assert "moved after the first runs, from 2 mm to 5 % of the gap" in said
    assert "1 of 2 answers would fail: deep." in said


def test_study_is_met_only_if_nearly_all_converge_and_none_is_wrong() -> None:
    good = [row(f"s{k}") for k in range(200)]
    assert summary(good)[0][0].startswith("Met: 200 of 200")
    lost = [row("lost", converged=False, checks_passed=None, message="runs away")]
    assert summary(good + lost)[0][0].startswith("Met: 200 of 201")
    assert summary(good + 3 * lost)[0][0].startswith("Not met")
    assert summary([*good, row("wrong", checks_passed=False)])[0][0].startswith("Not met")
    first, sections = summary(good + lost)
    assert "each listed below: lost." in first[1]
    assert sections[0].rows == [["lost", "linear", "0.49", "0.5", "5", "1", "flat", "0", "runs away"]]


def test_iterations_are_compared_in_pairs() -> None:
    ordinary = [row("a", newton_iterations=100), row("b", newton_iterations=40, shape="small")]
    worst = [row("c", nu=0.4999, newton_iterations=110), row("d", nu=0.4999, newton_iterations=90, friction="0.4")]
    assert "1.10 times" in summary(ordinary + worst)[0][0]
    too_many = [row("c", nu=0.4999, newton_iterations=140)]
    assert summary(ordinary + too_many)[0][0].startswith("Not met")


def test_the_finest_mesh_must_agree_with_the_next() -> None:
    group = [row("a"), row("b", elements=7, force_n=9.5), row("c", elements=10, force_n=9.3)]
    assert all(r["checks_passed"] for r in with_mesh_trend(group))
    jump = with_mesh_trend([*group, row("d", elements=14, force_n=5.0)])
    assert [r["checks_passed"] for r in jump] == [True, True, True, False]
    assert "coarser mesh" in jump[-1]["message"]


@requires_shared("twins")
def test_the_breast_of_a_scan_is_meshed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability_scan_mesh, "LEVELS", {"elements": (5,)})
    scan = DATA / "twins/mr/twin1.nii.gz"
    fields = run_stage("stability_scan_mesh", {"scan": scan}, tmp_path / "scan.h5", {}, Subject("cohort"))
    assert fields.status == "ok"
    assert Artefact(tmp_path / "scan.h5").array("points/5", "mm").shape == (6**3, 3)
