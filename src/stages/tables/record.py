"""What stage `tables` leaves: the cohort's tables with their columns, statistics, findings and failures."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from stages.engine.artefact import Fields, Value
from stages.engine.record import Record
from stages.formats.table import Table
from stages.localize.record import MrRow

_OVERLAP = {"overlap_percent": 1, "dice": 3, "size_ratio": 2}

PREDICTIONS_MAMMOGRAM = Table(
    "predictions_mammogram",
    "Where each mammogram shows what is marked in the MR volume",
    "localize",
    "mammogram_rows",
    ("view", "method", "name"),
    {"column": 2, "row": 2, "radius_mm": 2},
    ("seen", "message"),
)
PREDICTIONS_MR = Table(
    "predictions_mr",
    "Where in the MR volume the lesions marked in the mammograms lie",
    "localize",
    "mr_rows",
    ("views", "method", "name"),
    dict.fromkeys((field.name for field in fields(MrRow) if field.type == float | None), 2),
    ("clock", "message"),
    ("case", *(field.name for field in fields(MrRow))),
)
PREDICTIONS_COMPRESSED = Table(
    "predictions_compressed",
    "Landmarks carried into the compressed MR volume",
    "localize",
    "compressed_rows",
    ("method", "name"),
    {"x": 2, "y": 2, "z": 2},
    ("message",),
)
VIEWS = Table(
    "views",
    "Pose and fit of each view",
    "evaluate",
    "view_rows",
    ("view", "method"),
    {
        **dict.fromkeys(("angle_deg", "edge_p_mm", "middle_mm", "height_mm", "thickness_mm"), 2),
        "force_n": 1,
        "outline_mean_mm": 2,
        "outline_p95_mm": 2,
        "outline_dice": 3,
        "ncc": 3,
        "outline_step": 3,
        "penetration_mm": 2,
        "folded_corners": 0,
    },
    ("estimated", "trust"),
)
SEGMENTATION = Table(
    "segmentation",
    "Each MR breast beside what is usual of one",
    "segment",
    "checks",
    ("check",),
    {"value": 3, "low": 3, "high": 3},
    ("unit", "doubt"),
)
TABLE_5 = Table(
    "table_5_mammogram",
    "Table V: lesions in the mammograms",
    "evaluate",
    "table_5_rows",
    ("view", "method", "name"),
    {"distance_mm": 2, **_OVERLAP},
)
TABLE_6 = Table(
    "table_6_mr",
    "Table VI: lesions in the MR volumes",
    "evaluate",
    "table_6_rows",
    ("views", "method", "name"),
    {"distance_mm": 2, **_OVERLAP, "distance_to_curve_mm": 2},
)
ELONGATION = Table(
    "elongation",
    "Elongation of the breast across the beam",
    "evaluate",
    "elongation_rows",
    ("view", "method", "direction"),
    {"elongation_mm": 2, "true_mm": 2},
)
LANDMARKS = Table(
    "landmarks",
    "Landmarks with a truth",
    "evaluate",
    "landmark_rows",
    ("view", "method", "landmark"),
    {"distance_mm": 2},
)

TABLES = (
    PREDICTIONS_MAMMOGRAM,
    PREDICTIONS_MR,
    PREDICTIONS_COMPRESSED,
    VIEWS,
    SEGMENTATION,
    TABLE_5,
    TABLE_6,
    ELONGATION,
    LANDMARKS,
)

FAILURES = ("case", "view", "stage", "status", "message")
"""Columns of `failures.csv`: a row for each stage that failed first."""

CSV_FILES = (*(f"{table.name}.csv" for table in TABLES), "summary.csv", "findings.csv", "failures.csv")
"""What stage `tables` writes beside `cohort.nc` and the readable forms."""


def tables_fields(
    files: Mapping[str, bytes],
    statistics: Sequence[Mapping[str, Any]],
    findings: Sequence[Sequence[str]],
    failures: Sequence[str],
) -> Fields:
    """The artefact's contents: files by name, rows of `summary.csv` and `findings.csv`, and failures in words."""
    values: dict[str, Value] = {
        "statistics": [dict(row) for row in statistics],
        "findings": [list(row) for row in findings],
        "failures": list(failures),
    }
    return Fields(files=files, values=values)


class TablesRecord(Record):
    """What the report shows of the tables."""

    @property
    def statistics(self) -> list[Mapping[str, Any]]:
        """Rows of `summary.csv`."""
        return list(self.artefact.value("statistics"))

    @property
    def findings(self) -> list[list[str]]:
        """Rows of `findings.csv`: the paper's statements, held or not."""
        return list(self.artefact.value("findings"))


def reduction_text(row: Mapping[str, str], prefix: str = "") -> str:
    """By how much a mean lies below that of `rigid`, in percent, with how many of all were compared."""
    percent, compared, of = (row[f"{prefix}{name}"] for name in ("reduction_percent", "compared", "of"))
    return f"{percent} ({compared} of {of})" if percent else ""
