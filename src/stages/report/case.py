"""One case's part of the report."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mammoreg.localization.to_mr import DEPTH_UNCERTAIN, DEPTH_UNKNOWN
from mammoreg.metrics.summary import summarise
from stages.engine.artefact import Artefact
from stages.engine.completion import first_failures
from stages.figures.record import FiguresRecord
from stages.formats.pages import Section, cells, section_of
from stages.formats.table import Table
from stages.localize.record import FILLING, LARGE, STRAY, Predictions
from stages.methods import SHOWN_METHOD
from stages.segment.record import SegmentRecord
from stages.tables.record import LANDMARKS, PREDICTIONS_MAMMOGRAM, PREDICTIONS_MR, SEGMENTATION, TABLE_5, TABLE_6, VIEWS
from stages.views import SECOND_VOLUME, view_order

SIDES = {"L": "left", "R": "right"}


@dataclass(frozen=True)
class ReportPicture:
    """A picture within the page itself, as a data address; without one the file was not found."""

    title: str
    caption: str
    address: str | None


@dataclass(frozen=True)
class CasePage:
    """What the report shows of a case."""

    name: str
    side: str
    views: Sequence[str]
    status: str
    troubles: Sequence[str]
    warnings: Sequence[str]
    headline: Sequence[tuple[str, str]]
    exported: bool
    pictures: Sequence[ReportPicture]
    sections: Sequence[Section]


def case_page(name: str, laterality: str, artefacts: Sequence[Artefact]) -> CasePage:
    """The part of one case.

    Args:
        name: its id.
        laterality: side of the breast.
        artefacts: all that the case left, in the order of the pipeline.
    """
    failures = [failure for _, failure in first_failures(artefacts)]
    return CasePage(
        name,
        SIDES[laterality],
        sorted({str(a.view) for a in artefacts if a.view}, key=view_order),
        next((str(failure.status) for failure in failures), "ok").replace("_", " "),
        [f"{failure.view}: {failure}" if failure.view else str(failure) for failure in failures],
        _warnings(artefacts),
        _headline(artefacts),
        any(FiguresRecord(a).exported for a in artefacts if a.stage == "figures"),
        [picture for a in artefacts if a.stage == "figures" for picture in _pictures(FiguresRecord(a))],
        [section for section in _sections(artefacts) if section.rows],
    )


def _warnings(artefacts: Sequence[Artefact]) -> list[str]:
    """What speaks against the full registration, and what stages remarked."""
    rows = [row for row in VIEWS.rows(artefacts) if row["method"] == SHOWN_METHOD and row.get("trust")]
    found = [f"{row['view']}: {row['trust']}" for row in rows]
    found += [*_unknown_depths(artefacts), *_stray_marks(artefacts)]
    for artefact in artefacts:
        for name in ("warnings", "flags", "mr_series_notes", "mr_compressed_series_notes"):
            remarks = artefact.value(name) if artefact.has(name) else []
            found += [
                f"{artefact.view or artefact.stage}: {r}" for r in remarks if not any(r in text for text in found)
            ]
    return found


def _unknown_depths(artefacts: Sequence[Artefact]) -> list[str]:
    """Lesions that one view alone shows, or views along nearly one beam."""
    rows = [row for row in PREDICTIONS_MR.rows(artefacts) if row["method"] == SHOWN_METHOD]
    unknown = (DEPTH_UNKNOWN, DEPTH_UNCERTAIN)
    told = [row for row in rows if any(text in row["message"] for text in unknown)]
    return [f"{row['views']}, {row['name']}: {row['message']}" for row in told]


def _stray_marks(artefacts: Sequence[Artefact]) -> list[str]:
    """Marks that do not lie in the breast."""
    tables = ((PREDICTIONS_MAMMOGRAM, "view"), (PREDICTIONS_MR, "views"))
    return [
        f"{row[column]}, {row['name']}: {row['message']}"
        for table, column in tables
        for row in table.rows(artefacts)
        if row["method"] == SHOWN_METHOD and any(text in row["message"] for text in (STRAY, FILLING, LARGE))
    ]


def _headline(artefacts: Sequence[Artefact]) -> list[tuple[str, str]]:
    """Mean distance of the full registration for each kind of truth that the case has."""
    kinds = (
        ("lesion in mammogram", TABLE_5, False),
        ("lesion in MR", TABLE_6, False),
        ("landmarks in mammogram", LANDMARKS, False),
        ("landmarks between plates", LANDMARKS, True),
    )
    found = []
    for label, table, second_volume in kinds:
        rows = [row for row in table.rows(artefacts) if row["method"] == SHOWN_METHOD]
        rows = [row for row in rows if (row.get("view") == SECOND_VOLUME) == second_volume]
        if rows:
            found.append((label, mean_text([row["distance_mm"] for row in rows])))
    return found


def mean_text(distances: Sequence[float | None]) -> str:
    """Mean distance with what it counts, such as `3.2 mm (4 of 5)`."""
    summary = summarise(distances)
    count = f"{summary.n} of {summary.of}"
    return f"no prediction ({count})" if summary.mean_mm is None else f"{summary.mean_mm:.1f} mm ({count})"


def _pictures(figures: FiguresRecord) -> list[ReportPicture]:
    return [ReportPicture(p.title, p.caption, _address(figures.png(p))) for p in figures.pictures]


def _address(png: bytes | None) -> str | None:
    return None if png is None else png_address(png)


def png_address(content: bytes) -> str:
    """A PNG as an address that needs no file."""
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"


def _sections(artefacts: Sequence[Artefact]) -> list[Section]:
    lesions = {name for a in artefacts if a.stage == "localize" for name in Predictions(a).mr_lesions}
    return [
        _section("Lesion predicted in the mammogram", PREDICTIONS_MAMMOGRAM, artefacts, lesions),
        _section("Lesion predicted in the MR volume (LPS, mm)", PREDICTIONS_MR, artefacts),
        _section("Lesion in the mammogram against the truth", TABLE_5, artefacts),
        _section("Lesion in the MR volume against the truth", TABLE_6, artefacts),
        section_of("Landmarks against the truth", _landmark_rows(artefacts)),
        _turned(_section("Pose and fit of each view", VIEWS, artefacts)),
        _section("Segmentation beside what is usual", SEGMENTATION, artefacts),
        section_of(
            "MR series in the folder",
            [row for a in artefacts if a.stage == "segment" and a.ok for row in SegmentRecord(a).mr_series],
        ),
    ]


def _section(heading: str, table: Table, artefacts: Sequence[Artefact], names: set[str] | None = None) -> Section:
    """A table's rows of this case without the columns that are empty throughout; `names` limits what is shown."""
    rows = [row for row in table.rows(artefacts) if names is None or row["name"] in names]
    filled = [c for c in table.columns if c != "case" and any(row.get(c) not in (None, "") for row in rows)]
    place = [table.columns.index(column) for column in filled]
    return Section(heading, filled, [[line[i] for i in place] for line in cells(table, rows)])


def _turned(section: Section) -> Section:
    """A table with many columns and few rows, turned: one column per view and method, which stand first."""
    heads = [" ".join(row[:2]) for row in section.rows]
    lines = [[name, *(row[i] for row in section.rows)] for i, name in enumerate(section.columns)][2:]
    return Section(section.heading, ["", *heads], lines)


def _landmark_rows(artefacts: Sequence[Artefact]) -> list[dict[str, Any]]:
    """One row per view and method."""
    rows = LANDMARKS.rows(artefacts)
    found = []
    for view, method in dict.fromkeys((row["view"], row["method"]) for row in rows):
        summary = summarise([r["distance_mm"] for r in rows if (r["view"], r["method"]) == (view, method)])
        numbers = {"mean_mm": summary.mean_mm, "sd_mm": summary.sd_mm, "max_mm": summary.max_mm}
        texts = {name: "" if value is None else f"{value:.2f}" for name, value in numbers.items()}
        found.append({"view": view, "method": method, "n of N": f"{summary.n} of {summary.of}", **texts})
    return found
