"""Target `table_1`: its own job alone, and an artefact that a second call leaves as it is."""

import csv
from pathlib import Path

from tests.workflow.toy_project import make_cohort, make_project, snakemake


def test_table_1_needs_no_case_and_is_made_once(tmp_path: Path) -> None:
    project, cohort = make_project(tmp_path / "project"), make_cohort(tmp_path / "data", ("a",))
    keys = ["--config", f"cases={cohort}/cases.tsv", "results=results", "table_1={elements: [2]}"]
    done = snakemake(project, "table_1", *keys)
    assert done.returncode == 0, done.stdout
    results = project / "results"
    assert not (results / "a").exists()
    assert (results / "table_1.h5").exists()
    with (results / "tables/table_1_forces.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == 42
    assert (results / "tables/table_1_forces.html").exists()
    assert "Nothing to be done" in snakemake(project, "table_1", *keys).stdout
