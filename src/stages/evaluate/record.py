"""What stage `evaluate` leaves: rows of the tables that compare predictions with truth, and of `views.csv`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from stages.engine.artefact import Fields
from stages.engine.record import Record

Row = dict[str, Any]


@dataclass
class EvaluateFields:
    """Rows by table, without their column `case`, and what marks on both sides say against each other."""

    table_5_rows: list[Row] = field(default_factory=list)
    table_6_rows: list[Row] = field(default_factory=list)
    landmark_rows: list[Row] = field(default_factory=list)
    view_rows: list[Row] = field(default_factory=list)
    elongation_rows: list[Row] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def fields(self) -> Fields:
        """The artefact's contents."""
        return Fields(values=dict(vars(self)))


class EvaluateRecord(Record):
    """Distances of a case; of an artefact that failed what there is, perhaps nothing."""

    def distances(self, view: str) -> Sequence[tuple[str, float]]:
        """Method and distance, mm, of each landmark and lesion of a view that has a prediction and a truth."""
        rows = (row for name in ("landmark_rows", "table_5_rows") for row in self._given(name, []))
        return [
            (r["method"], float(r["distance_mm"])) for r in rows if r["view"] == view and r["distance_mm"] is not None
        ]
