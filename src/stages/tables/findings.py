"""What the paper says of Tables III, V and VI, judged by the cohort's lesions and landmarks."""

from collections.abc import Sequence
from dataclasses import replace

from mammoreg.metrics.findings import Claim, Numbers, judged, lower, numbers_of
from mammoreg.metrics.summary import LIMIT_MM
from stages.formats.findings import findings_rows
from stages.tables.statistics import IN_COMPRESSED, IN_MAMMOGRAMS, IN_MR, PRINTED, Group, summaries

_BOTH = ("table_5", "table_6")
_TABLE_OF = {IN_MAMMOGRAMS: "table_5", IN_MR: "table_6", IN_COMPRESSED: "table_3"}
_LARGEST_MM = 6.2
_IMPROVEMENT_PERCENT = {"table_5": 78, "table_6": 94}
_THREE_QUARTERS = 75.0


def _within(n: Numbers) -> float:
    """Share of the lesions' places of both tables within the paper's limit, in percent."""
    counts = [n[f"{table} updated n"] for table in _BOTH]
    return sum(n[f"{t} updated within"] * c for t, c in zip(_BOTH, counts, strict=True)) / sum(counts)


def _largest(n: Numbers) -> float:
    return max(n[f"{table} updated max"] for table in _BOTH)


def _lesions(table: str) -> tuple[Claim, ...]:
    """What section IV says of one of the tables."""
    rigid, plate, updated = (f"{table} {method}" for method in ("rigid", "plate", "updated"))
    percent = _IMPROVEMENT_PERCENT[table]
    return (
        Claim("plate compression places lesions nearer than rigid alignment", *lower(plate, rigid, "mean")),
        Claim(
            f"plate compression does not keep the mean within {LIMIT_MM:.0f} mm",
            lambda n: n[f"{plate} mean"] > LIMIT_MM,
            lambda n: f"{n[f'{plate} mean']:.1f} mm",
        ),
        Claim(
            "updated boundary conditions place lesions nearer than plate compression", *lower(updated, plate, "mean")
        ),
        Claim(
            f"updated boundary conditions keep the mean within {LIMIT_MM:.0f} mm",
            lambda n: n[f"{updated} mean"] <= LIMIT_MM,
            lambda n: f"{n[f'{updated} mean']:.1f} mm",
        ),
        Claim(
            f"updated boundary conditions improve on rigid alignment by {percent} % and more (mean of ratios)",
            lambda n: round(n[f"{updated} improvement"]) >= percent,
            lambda n: f"{n[f'{updated} improvement']:.0f} %",
        ),
    )


CLAIMS = {
    "table_3": (
        Claim("updated boundary conditions lower the mean", *lower("table_3 updated", "table_3 plate", "mean")),
        Claim("updated boundary conditions lower the maximum", *lower("table_3 updated", "table_3 plate", "max")),
        Claim(
            f"updated boundary conditions keep every landmark within {LIMIT_MM:.0f} mm",
            lambda n: n["table_3 updated max"] <= LIMIT_MM,
            lambda n: f"{n['table_3 updated max']:.1f} mm",
        ),
    ),
    "table_5": _lesions("table_5"),
    "table_6": _lesions("table_6"),
    "table_5 and table_6": (
        Claim(
            f"more than three quarters of the lesions' places lie within {LIMIT_MM:.0f} mm",
            lambda n: _within(n) > _THREE_QUARTERS,
            lambda n: f"{_within(n):.0f} %",
        ),
        Claim(
            f"no lesion's place is off by more than {_LARGEST_MM} mm",
            lambda n: _largest(n) <= _LARGEST_MM,
            lambda n: f"{_largest(n):.1f} mm",
        ),
    ),
}


def cohort_findings(groups: Sequence[Group]) -> list[list[str]]:
    """The statements that a cohort's tables can judge, as rows.

    Where a method could not predict all that has a truth, n of N stands behind the numbers, of the one with the fewest.
    """
    here: dict[str, float] = {}
    counts: dict[str, str] = {}
    paper: dict[str, float] = {}
    for group in groups:
        if table := _TABLE_OF.get(group.label):
            found = summaries(group)
            here |= numbers_of({f"{table} {method}": summary for method, summary in found.items()})
            fewest = min(found.values(), key=lambda summary: summary.n)
            counts[table] = f" ({fewest.n} of {fewest.of})" if fewest.n < fewest.of else ""
    for table, printed in PRINTED.items():
        paper |= numbers_of({f"{table} {method}": summary for method, (summary, _) in printed.items()})
    rows = []
    for tables, claims in CLAIMS.items():
        count = "".join(counts.get(table, "") for table in tables.split(" and "))
        findings = judged(claims, paper, here)
        counted = [replace(finding, here=finding.here and finding.here + count) for finding in findings]
        rows += findings_rows(tables, "cohort", counted)
    return rows
