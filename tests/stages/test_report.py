"""Stage `report`: one page that needs nothing else, whatever became of the cases."""

import base64
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.failures import Failure
from stages.engine.run import run_stage
from stages.report.case import case_page, mean_text
from stages.report.cohort import statistics_sections
from stages.tables.statistics import groups, statistics_rows
from tests.stages.pictured_case import run_figures, write_pictured_case

SECRET = "Jane <script>"


class Page(HTMLParser):
    """Attributes of all elements, and whether elements that are opened are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.identifiers: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.links += [str(value) for name, value in attrs if name in ("src", "href")]
        self.identifiers += [str(value) for name, value in attrs if name == "id"]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def failed_case(folder: Path, name: str, message: str) -> Path:
    path = folder / "segment.h5"
    header = {"stage": "segment", "case": name, "view": "", "laterality": "L", "artefact_id": name}
    write_artefact(path, header, Fields(failure=Failure("segment", "", "failed", message)))
    return path


def write_report(folder: Path, inputs: dict[str, Any], cases: str) -> str:
    """Tables and report of a cohort; returns the page."""
    (folder / "cases.tsv").write_text(cases, encoding="utf-8")
    artefacts = {k: v for k, v in inputs.items() if isinstance(v, list)}
    tables = {k: v for k, v in artefacts.items() if k != "figures"}
    subject = Subject("cohort")
    run_stage("tables", tables, folder / "tables.h5", {}, subject)
    given = artefacts | {"tables": [folder / "tables.h5"], "cases": [folder / "cases.tsv"]}
    run_stage("report", given, folder / "report.h5", {}, subject)
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def cohort(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A case that went well and one whose MR volume was bad."""
    folder = tmp_path_factory.mktemp("cohort")
    inputs = write_pictured_case(folder / "case1", "R", ("CC", "MLO"))
    run_figures(folder / "case1", inputs)
    inputs["figures"] = [folder / "case1" / "figures.h5"]
    (folder / "case2").mkdir()
    inputs["segment"].append(failed_case(folder / "case2", "case2", f"no breast found {SECRET}"))
    return folder, inputs


CASES = "case\tlaterality\tmr\texclude\ncase1\tR\ta.nii\t\ncase2\tL\tb.nii\t\nlate\tL\tc.nii\tmoved & blurred\n"


def test_the_page_shows_every_case_and_needs_no_network(cohort: tuple[Path, dict[str, Any]]) -> None:
    text = write_report(*cohort, CASES)
    page = Page(text)
    assert not page.open
    assert not re.search(r"(src|href)=\"(https?:)?//", text)
    inside = [link[1:] for link in page.links if link.startswith("#")]
    assert set(inside) <= set(page.identifiers)
    assert {"case-case1", "case-case2"} <= set(page.identifiers)
    pictures = [link for link in page.links if link.startswith("data:image/png;base64,")]
    assert len(pictures) == 1 + len(list((cohort[0] / "case1" / "figures").glob("*.png")))
    for picture in pictures:
        assert base64.b64decode(picture.split(",")[1]).startswith(b"\x89PNG")


def test_failures_exclusions_and_what_is_safe_to_show(cohort: tuple[Path, dict[str, Any]]) -> None:
    text = write_report(*cohort, CASES)
    assert "1 of 2" in text
    assert "no breast found Jane &lt;script&gt;" in text
    assert SECRET not in text
    assert "moved &amp; blurred" in text
    assert "research use only" in text.lower()
    assert str(cohort[0]) not in text


def test_the_page_of_a_case_with_one_view_says_that_the_depth_is_not_determined(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("CC",))
    artefacts = [Artefact(path) for stage in ("localize", "evaluate") for path in inputs[stage]]
    warnings = case_page("case1", "R", artefacts).warnings
    assert any(text.startswith("CC, lesion: one view does not determine the depth") for text in warnings)


def test_numbers_stand_at_the_right(cohort: tuple[Path, dict[str, Any]]) -> None:
    text = write_report(*cohort, CASES)
    assert re.search(r'<td class="n">-?\d+\.\d+</td>', text)
    assert not re.search(r"<td>-?\d+\.\d+</td>", text)


def test_links_to_tables_lead_to_files(cohort: tuple[Path, dict[str, Any]]) -> None:
    page = Page(write_report(*cohort, CASES))
    links = [link for link in page.links if link.startswith("tables/")]
    assert links
    for link in links:
        assert (cohort[0] / link).is_file(), link


def test_a_rerun_is_identical(cohort: tuple[Path, dict[str, Any]]) -> None:
    assert write_report(*cohort, CASES) == write_report(*cohort, CASES)


def test_a_missing_picture_is_named(cohort: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    moved = tmp_path / "figures.h5"
    old = Artefact(cohort[1]["figures"][0])
    attrs = {k: v for k, v in old.attrs.items() if k not in ("status", "message")}
    write_artefact(moved, attrs, Fields(values={"pictures": old.value("pictures")}))
    text = write_report(cohort[0], cohort[1] | {"figures": [moved]}, CASES)
    assert "run the stage figures of this case again" in text


def test_a_cohort_in_which_all_failed(tmp_path: Path) -> None:
    folder = tmp_path / "case2"
    folder.mkdir()
    inputs = {"segment": [failed_case(folder, "case2", "volume of NaN")]}
    text = write_report(tmp_path, inputs, "case\tlaterality\tmr\ncase2\tL\tb.nii\n")
    assert "0 of 1" in text
    assert "volume of NaN" in text
    assert not Page(text).open


@pytest.mark.parametrize(
    ("distances", "text"),
    [([3.0, 4.0], "3.5 mm (2 of 2)"), ([3.0, None], "3.0 mm (1 of 2)"), ([None], "no prediction (0 of 1)")],
)
def test_mean_text(distances: list[float | None], text: str) -> None:
    assert mean_text(distances) == text


def test_statistics_count_and_drop_empty_columns() -> None:
    keys = ("sd_mm", "median_mm", "max_mm", "within_5_mm_percent", "reduction_percent", "overlap_percent")
    paper = ("paper_mean_mm", "paper_sd_mm", "paper_max_mm", "paper_overlap_percent")
    row = dict.fromkeys((*keys, *paper), "") | {"group": "points", "method": "rigid", "n": "3", "of": "4"}
    (section,) = statistics_sections([row | {"mean_mm": "7.40"}])
    assert list(section.columns) == ["method", "n of N", "mean (mm)"]
    assert section.rows == [["rigid", "3 of 4", "7.40"]]


def test_the_front_page_compares_means_and_not_ratios() -> None:
    """One lucky hit of `rigid` makes the paper's mean of ratios -85 %, beside 2.7 mm against 8.7 mm."""
    distances = {"rigid": (0.3, 12.0, 14.0), "updated": (1.5, 3.0, 3.5)}
    rows = [
        {"case": str(i), "views": "CC+MLO", "method": method, "name": "lesion", "distance_mm": d}
        for method, found in distances.items()
        for i, d in enumerate(found)
    ]
    (group,) = groups([], [*rows, {**rows[0], "case": "4", "distance_mm": None}], [])
    (section,) = statistics_sections(statistics_rows(group))
    column = list(section.columns).index("mean below rigid's (%)")
    assert [row[column] for row in section.rows if row[0] == "updated"] == ["69.6 (3 of 3)"]
    (updated,) = [row for row in statistics_rows(group) if row["method"] == "updated"]
    assert float(updated["improvement_percent"]) < 0.0
    assert not any("better than rigid" in name for name in section.columns)
