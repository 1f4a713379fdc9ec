"""Summary statistics of the cohort's distances, beside the paper's own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mammoreg.metrics.paper import METHODS, TABLE_3, TABLE_5, TABLE_6, paper_overlap_percent, paper_summary
from mammoreg.metrics.summary import Summary, summarise
from stages.formats.table import Row

COLUMNS = ("n", "of", "mean_mm", "sd_mm", "median_mm", "max_mm", "within_5_mm_percent", "improvement_percent")
_DECIMALS = (None, None, 2, 2, 2, 2, 1, 1)


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
    printed_5 = {m: (paper_summary(TABLE_5, m), paper_overlap_percent(TABLE_5, m)) for m in METHODS}
    printed_6 = {m: (paper_summary(TABLE_6, m), paper_overlap_percent(TABLE_6, m)) for m in METHODS}
    volunteer = {method: (summary, None) for method, summary in TABLE_3.items()}
    carried = [row for row in landmarks if row["view"] == "3D"]
    projected = [row for row in landmarks if row["view"] != "3D"]
    found = [
        Group("table_5_mammogram", "lesions in the mammograms", table_5, printed_5),
        Group("table_6_mr", "lesions in the MR volumes, from two views", both, printed_6),
        Group("table_6_mr", "lesions in the MR volumes, from one view", one, {}),
        Group("landmarks", "landmarks in the mammograms", projected, {}),
        Group("landmarks", "landmarks in the compressed volume", carried, volunteer),
    ]
    return [group for group in found if group.rows]


def statistics_rows(group: Group) -> list[dict[str, Any]]:
    """One row per method: the statistics, the mean overlap, and the paper's numbers with `paper_` before them."""
    rigid = {_subject(row): row["distance_mm"] for row in group.rows if row["method"] == "rigid"}
    rows = []
    for method in dict.fromkeys(row["method"] for row in group.rows):
        mine = [row for row in group.rows if row["method"] == method]
        summary = summarise([r["distance_mm"] for r in mine], [rigid.get(_subject(r)) for r in mine])
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
        "nearer than rigid, %": of("improvement_percent"),
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
    values = [getattr(summary, name) if summary else None for name in COLUMNS]
    return {f"{prefix}{name}": _fixed(v, d) for name, v, d in zip(COLUMNS, values, _DECIMALS, strict=True)}


def _fixed(value: float | None, decimals: int | None) -> str:
    if value is None:
        return ""
    return str(value) if decimals is None else f"{value:.{decimals}f}"


def _subject(row: Row) -> tuple[Any, ...]:
    """What a row is about, whatever its method and the views that it could use."""
    return row["case"], row.get("view"), row.get("name"), row.get("landmark")
