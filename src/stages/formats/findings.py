"""The paper's statements with what became of them here, as rows of a table."""

from collections.abc import Iterable

from mammoreg.metrics.findings import Finding

FINDINGS = ("table", "case", "statement", "held", "paper", "here")
"""Columns; `held` is empty where a statement could not be judged."""


def findings_rows(table: str, case: str, findings: Iterable[Finding]) -> list[list[str]]:
    """Rows of a table's findings; `case` is `cohort` where all cases are judged together."""
    return [[table, case, f.statement, _held(f), f.paper, f.here] for f in findings]


def _held(finding: Finding) -> str:
    return "" if finding.held is None else str(finding.held).lower()
