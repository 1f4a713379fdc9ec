"""Tables II to IV beside the paper's: their files, and the sentences that the numbers make."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mammoreg.metrics.findings import judged, numbers_of
from mammoreg.metrics.summary import Summary
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from stages.studies.volunteer.paper_sentences import CLAIMS, PAPER, sentences
from stages.studies.volunteer.stage import TABLES
from tests.stages import synthetic_case as synthetic

COLUMNS = {
    "table_2_materials": "case,model,landmark,distance_mm",
    "table_3_boundary": "case,boundary,landmark,distance_mm",
    "table_4_skin": "case,skin,landmark,distance_mm,lateral_mm",
}


@pytest.mark.parametrize("table", list(CLAIMS))
def test_the_paper_agrees_with_itself(table: str) -> None:
    paper = numbers_of(PAPER[table])
    (found,) = sentences(judged(CLAIMS[table], paper, paper))
    assert found.startswith("Agrees with the paper: ")
    assert found.count("(paper: ") == len(CLAIMS[table])


def test_numbers_decide() -> None:
    paper = PAPER["table_3"]
    worse = paper | {"updated": Summary(17, 17, mean_mm=3.24, sd_mm=1.0, max_mm=4.4)}
    agrees, differs = sentences(judged(CLAIMS["table_3"], numbers_of(paper), numbers_of(worse)))
    assert "additional points lower the mean (paper: 3.1 to 2.6 mm; here: 3.1 to 2.6 mm)" in agrees
    assert "updated boundary conditions keep every landmark within 5 mm (paper: 4.3 mm; here: 4.4 mm)" in agrees
    assert "updated boundary conditions lower the mean (paper: 3.1 to 2.7 mm; here: 3.1 to 3.2 mm)" in differs


def test_what_rounding_hides_counts_for_nothing() -> None:
    paper = PAPER["table_4"]
    same = dict.fromkeys(paper, Summary(17, 17, mean_mm=2.04, max_mm=5.0))
    same |= {"attached": replace(same["none"], mean_mm=1.96), "attached lateral": same["none"]}
    (found,) = sentences(judged(CLAIMS["table_4"], numbers_of(paper), numbers_of(same)))
    assert found.startswith("Does not agree: ")
    assert "attached skin lowers the mean distance (paper: 3.4 to 3.3 mm; here: 2.0 to 2.0 mm)" in found


def test_a_missing_solution_is_not_judged() -> None:
    paper = PAPER["table_2"]
    lacking = paper | {"azar": Summary(0, 17)}
    (unjudged,) = sentences(judged(CLAIMS["table_2"], numbers_of(paper), numbers_of(lacking)))
    assert unjudged.startswith("Could not be judged: ")
    assert unjudged.count("for want of a solution") == len(CLAIMS["table_2"])


def write_volunteer(path: Path, case: str, failed: tuple[str, ...] = ()) -> Path:
    """A volunteer of two landmarks whose distances are the means of the paper's table less and more 1 mm."""
    mechanics = {"own": {"friction": 0.4}, "plain": {"fibre_ratio": 0.0}, "smooth": {"friction": 0.0}}
    values: dict[str, Any] = {"runs": [], "mechanics": mechanics}
    for table, (key, names) in TABLES.items():
        known = {"before": 18.0, "translation": 6.0} | {name: PAPER[table][name].mean_mm for name in names}
        values[f"{table}_rows"] = [
            {key: name, "landmark": f"P{sign}"}
            | dict.fromkeys(("distance_mm", "lateral_mm"), None if name in failed else mean + sign)
            for name, mean in known.items()
            for sign in (-1, 1)
        ]
        values["runs"] += [
            {"table": table, "name": name, "message": "compress: it runs away" if name in failed else ""}
            | ({} if name in failed else {"force_n": 10.0, "moved_mm": 0.5})
            for name in names
        ]
    header = synthetic.header("volunteer", "R") | {"case": case, "artefact_id": case}
    write_artefact(path, header, Fields(values=values))
    return path


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    given = [write_volunteer(tmp_path / "a.h5", "a", ("azar",)), write_volunteer(tmp_path / "b.h5", "b")]
    run_stage("paper_tables", {"volunteer": given}, tmp_path / "paper_tables.h5", {}, Subject("cohort"))
    return tmp_path / "tables"


@pytest.mark.parametrize("name", list(COLUMNS))
def test_files_hold_the_columns_of_the_contract(tables: Path, name: str) -> None:
    with (tables / f"{name}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == COLUMNS[name]
    assert [rows[0]["case"], rows[-1]["case"]] == ["a", "b"]
    assert rows[0]["distance_mm"] == "17.00"


def test_a_failed_material_is_an_empty_distance_and_is_said_first(tables: Path) -> None:
    with (tables / "table_2_materials.csv").open(newline="") as file:
        distances = {(r["case"], r["model"], r["landmark"]): r["distance_mm"] for r in csv.DictReader(file)}
    assert distances["a", "azar", "P1"] == ""
    assert distances["b", "azar", "P1"] == "4.10"
    page = (tables / "table_2_materials.md").read_text()
    assert page.index("a, azar: compress: it runs away") < page.index("## a: distances")
    assert "| azar        | 0 of 2 |" in page
    (wellman,) = [line for line in page.splitlines() if line.startswith("| wellman") and "2 of 2" in line][1:]
    assert [cell.strip() for cell in wellman.split("|")[2:-1]] == ["2 of 2", "3.1 (1.0)", "4.1", "3.1 (1.4)", "5.1"]


def test_pages_show_both_numbers_sentences_and_settings(tables: Path) -> None:
    page = (tables / "table_4_skin.html").read_text()
    for text in (
        "<h2>b: distances in mm</h2>",
        "Agrees with the paper: attached skin lowers the mean distance (paper: 3.4 to 3.3 mm; here: 3.4 to 3.3 mm)",
        "Does not agree: every skin lowers the mean lateral distance (paper: 2.6 to 2.1 and 1.8 and 1.8 mm; here: ",
        "paper: lateral maximum",
        "friction 0.0",
        "<h2>Measurements</h2>",
    ):
        assert text in page
    assert "friction 0.4" in (tables / "table_3_boundary.md").read_text()
    said = Artefact(tables.parent / "paper_tables.h5").value("sentences")
    assert set(said) == set(COLUMNS)
    assert set(said["table_2_materials"]) == {"a", "b"}


def test_a_cohort_without_volunteers_says_so(tmp_path: Path) -> None:
    run_stage("paper_tables", {}, tmp_path / "paper_tables.h5", {}, Subject("cohort"))
    assert (tmp_path / "tables" / "table_3_boundary.csv").read_text().strip() == COLUMNS["table_3_boundary"]
    assert "no case of this cohort has landmarks" in (tmp_path / "tables" / "table_3_boundary.md").read_text()
