"""Target `stability`: its own jobs alone, with and without a scan, and a table that a second call leaves as it is."""

import csv
from pathlib import Path

from tests.workflow.toy_project import make_cohort, make_project, snakemake

FEW = "stability_batch={batches: 2, only: [mesh-01-5, scan-01]}"


def test_stability_needs_no_case_and_is_made_once(tmp_path: Path) -> None:
    project, cohort = make_project(tmp_path / "project"), make_cohort(tmp_path / "data", ("a",))
    keys = ["--config", f"cases={cohort}/cases.tsv", "results=results", FEW]
    done = snakemake(project, "stability", *keys)
    results = project / "results"
    assert done.returncode == 0, done.stdout
    with (results / "tables/stability.csv").open(newline="") as file:
        rows = {row["scenario"]: row for row in csv.DictReader(file)}
    assert len(rows) == 240
    assert rows["mesh-01-5"]["converged"] == "true"
    assert rows["scan-01"]["message"] == "not run: stability_scan is not set"
    assert sorted(path.name for path in (results / "figures").iterdir()) == ["stability.png"]
    assert not list(results.glob("a/*"))
    assert "Nothing to be done" in snakemake(project, "stability", *keys).stdout
    with_scan = snakemake(project, "-n", "stability", *keys, f"stability_scan={cohort}/a.nii.gz").stdout
    assert "stability_scan_mesh" in with_scan
