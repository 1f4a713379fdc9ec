"""The cohort at a glance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stages.cohort.cases import Cohort
from stages.engine.artefact import Artefact
from stages.formats.pages import Section
from stages.formats.table import Row
from stages.methods import SHOWN_METHOD
from stages.report.case import png_address
from stages.tables.record import LANDMARKS, TABLE_5, TABLE_6, reduction_text
from stages.views import SECOND_VOLUME

Statistics = Sequence[Mapping[str, Any]]
_COLUMNS = {
    "method": "method",
    "mean_mm": "mean (mm)",
    "sd_mm": "SD",
    "median_mm": "median",
    "max_mm": "max",
    "within_5_mm_percent": "≤ 5 mm (%)",
    "reduction_percent": "mean below rigid's (%)",
    "overlap_percent": "overlap (%)",
    "paper_mean_mm": "paper: mean",
    "paper_sd_mm": "SD",
    "paper_max_mm": "max",
    "paper_overlap_percent": "overlap (%)",
}


@dataclass(frozen=True)
class Card:
    """One number that stands at the top of the report."""

    number: str
    label: str
    beside: str = ""


def cards(statistics: Statistics, done: int, of: int) -> list[Card]:
    """Complete cases, and the mean distance of the full registration in each group, with the paper's.

    One view alone gives a curve and no point, so its group is left to the tables.
    """
    found = [Card(f"{done} of {of}", "cases complete")]
    for row in statistics:
        if row["method"] == SHOWN_METHOD and row["mean_mm"] and "one view" not in row["group"]:
            paper = f"paper: {row['paper_mean_mm']} mm" if row["paper_mean_mm"] else ""
            count = f"{row['n']} of {row['of']}"
            found.append(Card(f"{float(row['mean_mm']):.1f} mm", f"{count} {row['group']}, mean", paper))
    return found


def statistics_sections(statistics: Statistics) -> list[Section]:
    """One table per group: a line per method, the paper's numbers at the right."""
    sections = []
    for group in dict.fromkeys(row["group"] for row in statistics):
        rows = [row for row in statistics if row["group"] == group]
        shown = [key for key in _COLUMNS if any(row[key] for row in rows)]
        header = [_COLUMNS[key] for key in shown]
        lines = [[reduction_text(row) if key == "reduction_percent" else row[key] for key in shown] for row in rows]
        counts = [f"{row['n']} of {row['of']}" for row in rows]
        for line, count in zip(lines, counts, strict=True):
            line.insert(1, count)
        sections.append(Section(_sentence(group), [header[0], "n of N", *header[1:]], lines))
    return sections


def findings_section(findings: Sequence[Sequence[str]]) -> Section:
    """The paper's statements that this cohort can judge; no row without any truth."""
    words = {"true": "held", "false": "not held"}
    rows = [
        [table.replace("_", " ").replace("table", "Table"), statement, words[held], paper, here]
        for table, _, statement, held, paper, here in findings
        if held
    ]
    return Section("The paper's statements", ["of", "statement", "here", "paper's numbers", "numbers here"], rows)


def _sentence(text: str) -> str:
    """The text with a capital first letter, the others as they are."""
    return text[:1].upper() + text[1:]


def excluded_rows(cohort: Cohort) -> list[tuple[str, str]]:
    """What the tables leave out, and why."""
    cases = [(row.case, row.exclude) for row in cohort.all_cases if row.exclude]
    views = [(f"{row.case} {row.view}", row.exclude) for row in cohort.all_views if row.exclude]
    return [(name, str(reason)) for name, reason in cases + views]


def errors_picture(artefacts: Sequence[Artefact], statistics: Statistics) -> str | None:
    """All distances by method as a picture's address; None without any truth."""
    # Only this function pays for matplotlib.
    from mammoreg.plots.accuracy import ErrorPanel, error_panels

    landmarks = LANDMARKS.rows(artefacts)
    kinds = {
        "lesions in the mammograms": TABLE_5.rows(artefacts),
        "lesions in the MR volumes, from two views": [r for r in TABLE_6.rows(artefacts) if "+" in r["views"]],
        "landmarks in the mammograms": [row for row in landmarks if row["view"] != SECOND_VOLUME],
        "landmarks in the compressed volume": [row for row in landmarks if row["view"] == SECOND_VOLUME],
    }
    panels = [
        ErrorPanel(_sentence(group.split(", ")[0]), _by_method(rows), _paper_means(statistics, group))
        for group, rows in kinds.items()
        if any(row["distance_mm"] is not None for row in rows)
    ]
    return png_address(error_panels(panels).tobytes()) if panels else None


def _by_method(rows: Sequence[Row]) -> dict[str, list[float]]:
    methods = dict.fromkeys(row["method"] for row in rows)
    return {
        method: [row["distance_mm"] for row in rows if row["method"] == method and row["distance_mm"] is not None]
        for method in methods
    }


def _paper_means(statistics: Statistics, group: str) -> dict[str, float]:
    return {
        row["method"]: float(row["paper_mean_mm"])
        for row in statistics
        if row["group"] == group and row["paper_mean_mm"]
    }
