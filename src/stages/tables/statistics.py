"""Summary statistics of the cohort's distances, beside the paper's own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mammoreg.metrics.paper import (
    METHODS,
    TABLE_3,
    TABLE_5,
    TABLE_6,
    PaperRow,
    paper_overlap_percent,
    paper_summary,
)
from mammoreg.metrics.summary import Summary, summarise
from stages.formats.table import Row
from stages.tables.record import reduction_text
from stages.views import SECOND_VOLUME

COLUMNS = {
    "n": None,
    "of": None,
    "mean_mm": 2,
    "sd_mm": 2,
    "median_mm": 2,
    "max_mm": 2,
    "within_5_mm_percent": 1,
    "improvement_percent": 1,
    "reduction_percent": 1,
    "compared": None,
}
"""Statistics with their decimals."""
IN_MAMMOGRAMS = "lesions in the mammograms"
IN_MR = "lesions in the MR volumes, from two views"
IN_COMPRESSED = "landmarks in the compressed volume"


def _printed(table: tuple[PaperRow, ...]) -> dict[str, tuple[Summary, float | None]]:
    return {method: (paper_summary(table, method), paper_overlap_percent(table, method)) for method in METHODS}


PRINTED: Mapping[str, Mapping[str, tuple[Summary, float | None]]] = {
    "table_3": {method: (summary, None) for method, summary in TABLE_3.items()},
    "table_5": _printed(TABLE_5),
    "table_6": _printed(TABLE_6),
}
"""The paper's statistics by table and method, and the mean overlap in percent where it gives one."""


@dataclass(frozen=True)
class Group:
    """A set of measurements that is summarised by method.

    Attributes:
        table: name of the table whose rows they are.
        label: what they are.
        rows: of all methods.
        paper: the paper's statistics by method, and the mean overlap in percent where it gives one.
    """

    table: str
    label: str
    rows: Sequence[Row]
    paper: Mapping[str, tuple[Summary, float | None]]


def groups(table_5: Sequence[Row], table_6: Sequence[Row], landmarks: Sequence[Row]) -> list[Group]:
    """The groups that are summarised; only two-view lesions enter Table VI's means."""
    both = [row for row in table_6 if "+" in row["views"]]
    one = [row for row in table_6 if "+" not in row["views"]]
    carried = [row for row in landmarks if row["view"] == SECOND_VOLUME]
    projected = [row for row in landmarks if row["view"] != SECOND_VOLUME]
    found = [
        Group("table_5_mammogram", IN_MAMMOGRAMS, table_5, PRINTED["table_5"]),
        Group("table_6_mr", IN_MR, both, PRINTED["table_6"]),
        Group("table_6_mr", "lesions in the MR volumes, from one view", one, {}),
        Group("landmarks", "landmarks in the mammograms", projected, {}),
        Group("landmarks", IN_COMPRESSED, carried, PRINTED["table_3"]),
    ]
    return [group for group in found if group.rows]


def summaries(group: Group) -> dict[str, Summary]:
    """Statistics by method."""
    rigid = {_subject(row): row["distance_mm"] for row in group.rows if row["method"] == "rigid"}
    found = {}
    for method in dict.fromkeys(row["method"] for row in group.rows):
        mine = [row for row in group.rows if row["method"] == method]
        found[method] = summarise([r["distance_mm"] for r in mine], [rigid.get(_subject(r)) for r in mine])
    return found


def statistics_rows(group: Group) -> list[dict[str, Any]]:
    """One row per method: the statistics, the mean overlap, and the paper's numbers with `paper_` before them."""
    rows = []
    for method, summary in summaries(group).items():
        mine = [row for row in group.rows if row["method"] == method]
        overlaps = [r["overlap_percent"] for r in mine if r.get("overlap_percent") is not None]
        row = {"table": group.table, "group": group.label, "method": method, **_texts(summary, "")}
        row["overlap_percent"] = f"{sum(overlaps) / len(overlaps):.1f}" if overlaps else ""
        printed, overlap = group.paper.get(method, (None, None))
        row |= _texts(printed, "paper_")
        row["paper_overlap_percent"] = "" if overlap is None else f"{overlap:.1f}"
        rows.append(row)
    return rows


def readable_rows(statistics: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """The same in fewer columns and in words; a column that is empty in all rows is left out."""
    rows = [{"method": row["method"], **_words(row, ""), **_words(row, "paper_")} for row in statistics]
    return [{name: row[name] for name in row if any(other[name] for other in rows)} for row in rows]


def _words(row: Mapping[str, str], prefix: str) -> dict[str, str]:
    def of(name: str) -> str:
        return row[f"{prefix}{name}"]

    words = {
        "n of N": f"{of('n')} of {of('of')}" if of("of") else "",
        "mean (SD), mm": f"{of('mean_mm')} ({of('sd_mm')})" if of("mean_mm") else "",
        "median, mm": of("median_mm"),
        "maximum, mm": of("max_mm"),
        "within 5 mm, %": of("within_5_mm_percent"),
        "improvement over rigid, mean of ratios (the paper's), %": of("improvement_percent"),
        "mean below that of rigid (ours), %": reduction_text(row, prefix),
        "overlap, %": of("overlap_percent"),
    }
    return {f"{'paper: ' if prefix else ''}{name}": text for name, text in words.items()}


def incomplete(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """What a table says first: the methods that could not predict all that has a truth."""
    return [
        f"{row['method']}: {row['n']} of {row['of']} {row['group']} have a prediction"
        for row in rows
        if row["n"] != row["of"]
    ]


def _texts(summary: Summary | None, prefix: str) -> dict[str, str]:
    return {f"{prefix}{name}": _fixed(getattr(summary, name, None), digits) for name, digits in COLUMNS.items()}


def _fixed(value: float | None, decimals: int | None) -> str:
    if value is None:
        return ""
    return str(value) if decimals is None else f"{value:.{decimals}f}"


def _subject(row: Row) -> tuple[Any, ...]:
    """What a row is about, whatever its method and the views that it could use."""
    return row["case"], row.get("view"), row.get("name"), row.get("landmark")
