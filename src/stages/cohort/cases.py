"""The two tables that a user hands in: their models, and the cohort that they describe."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from mammoreg.imaging.views import View
from stages.cohort.readers.mammogram.view_codes import registrable_view
from stages.cohort.rows import Row, looks_like, read_rows
from stages.cohort.series import series_token
from stages.engine.errors import Fault, FaultsError
from stages.views import SECOND_VOLUME, view_order

RESERVED = ("tables", "figures", "benchmarks", "logs", "digital")
PICTURES = (".png", ".tif", ".tiff")


def _not_reserved(name: str) -> str:
    if name in RESERVED:
        raise ValueError(f"{name!r} is taken: the results folder uses {', '.join(RESERVED)}")
    return name


CaseId = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9_-]+$", description="unique id of the breast"), AfterValidator(_not_reserved)
]
ViewName = Annotated[View, BeforeValidator(registrable_view)]
Pseudonym = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_EXCLUDE = Field(None, description="a reason; the row is kept, not run, and the report says why")


class CaseRow(Row):
    """One breast."""

    case: CaseId
    laterality: Literal["L", "R"] = Field(description="side of the breast")
    mr: Path = Field(
        description="undeformed MR volume: NIfTI, or a folder of DICOM files, a patient's whole export at best: "
        "the fitting series is chosen and named"
    )
    mr_series: str | None = Field(
        None,
        pattern=r"^[0-9]+(\.[0-9]+)*$",
        description="SeriesNumber or SeriesInstanceUID of the series to take, where the choice is to be another",
    )
    mr_labels: Path | None = Field(
        None,
        description="NIfTI on the MR grid that replaces the automatic segmentation: "
        "0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall",
    )
    mr_lesion: Path | None = Field(
        None,
        description="NIfTI mask on the MR grid, 3D Slicer segmentation (.seg.nrrd), DICOM SEG, or "
        ".tsv with name, x, y, z, diameter_mm (LPS, mm), or 3D Slicer markups (.mrk.json, .fcsv)",
    )
    mr_landmarks: Path | None = Field(None, description=".tsv with name, x, y, z (LPS, mm), or 3D Slicer markups")
    mr_compressed: Path | None = Field(None, description="second MR volume of the breast between the plates")
    mr_compressed_landmarks: Path | None = Field(None, description=".tsv with the same names in the second volume")
    mr_surface_points: Path | None = Field(None, description=".tsv with points of the skin before compression")
    mr_compressed_surface_points: Path | None = Field(None, description=".tsv with the same points between the plates")
    compression: float | None = Field(
        None,
        gt=0,
        lt=0.9,
        allow_inf_nan=False,
        description="share of the uncompressed thickness that the plates take away, such as 0.21",
    )
    patient: Pseudonym | None = Field(None, description="pseudonym that ties the breasts of one woman together")
    exam: Pseudonym | None = Field(None, description="pseudonym of the examination, where there are several")
    exclude: str | None = _EXCLUDE

    def values(self) -> dict[str, str]:
        """Columns that are values, as texts."""
        series = None if self.mr_series is None else series_token(self.mr_series)
        return _texts({"compression": self.compression, "mr_series": series})


class ViewRow(Row):
    """One mammogram."""

    case: CaseId
    view: ViewName = Field(description="projection")
    image: Path = Field(description="DICOM mammogram, or .png/.tif with pixel_spacing_mm")
    lesion: Path | None = Field(
        None, description=".png mask of the image's size, or .tsv with name, column, row, diameter_mm"
    )
    landmarks: Path | None = Field(None, description=".tsv with name, column, row (pixel centres, first pixel 0 0)")
    pixel_spacing_mm: Positive | None = Field(None, description="pixel spacing at the detector, mm")
    thickness_mm: Positive | None = Field(None, description="distance of the plates, mm")
    force_n: Positive | None = Field(None, description="plate force, N")
    angle_deg: float | None = Field(None, ge=-180, le=270, allow_inf_nan=False, description="projection angle, degree")
    source_detector_mm: Positive | None = Field(None, description="source-to-detector distance, mm")
    orientation: str | None = Field(
        None,
        pattern=r"^[APRLHF]{1,3}\\[APRLHF]{1,3}$",
        description=r"row and column direction as stored, such as A\R, P\L, A\FR or P\FL; where it is not known, "
        "the pose takes the order of rows that fits, and asks where neither does",
    )
    exclude: str | None = _EXCLUDE

    def values(self) -> dict[str, str]:
        """Columns that are values, as texts."""
        names = ("pixel_spacing_mm", "thickness_mm", "force_n", "angle_deg", "source_detector_mm", "orientation")
        return _texts({name: getattr(self, name) for name in names})


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(value) for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Cohort:
    """The cases and mammograms of two tables.

    Attributes:
        cases_file, views_file: the tables.
        all_cases, all_views: every row, excluded ones too.
    """

    cases_file: Path
    views_file: Path | None
    all_cases: tuple[CaseRow, ...]
    all_views: tuple[ViewRow, ...]

    @cached_property
    def cases(self) -> dict[str, CaseRow]:
        """Cases that run, by id."""
        return {row.case: row for row in self.all_cases if not row.exclude}

    @cached_property
    def mammograms(self) -> dict[tuple[str, str], ViewRow]:
        """Mammograms of cases that run, by case and view."""
        return {(row.case, row.view): row for row in self.all_views if not row.exclude and row.case in self.cases}

    def views(self, case: str) -> list[str]:
        """Views of a case: its mammograms, else 3D where a second volume or `compression` tells of plates."""
        found = sorted((view for name, view in self.mammograms if name == case), key=view_order)
        row = self.cases[case]
        return found or ([SECOND_VOLUME] if row.mr_compressed or row.compression else [])


def read_cohort(cases: Path, views: Path | None, files_in: Path | None = None) -> Cohort:
    """Read and check both tables.

    Args:
        cases: cases.tsv.
        views: views.tsv; None for a cohort without mammograms.
        files_in: folder that the tables' paths are relative to; None: each table's own.

    Raises:
        FaultsError: all that is wrong in them, at once.
    """
    _check_order(cases, views)
    faults: list[Fault] = []
    case_rows, ids = read_rows(cases, CaseRow, files_in, faults)
    view_rows = read_rows(views, ViewRow, files_in, faults)[0] if views else []
    faults += _duplicates(cases, [(n, (row.case,)) for n, row in case_rows])
    for number, row in case_rows:
        faults += _orphans(cases, number, row)
    if views:
        faults += _view_faults(views, view_rows, ids, cases.name)
    if not case_rows and not faults:
        faults.append(Fault(cases.name, "the table has no row", "add one row per breast"))
    if faults:
        raise FaultsError(faults)
    return Cohort(cases, views, tuple(row for _, row in case_rows), tuple(row for _, row in view_rows))


def _check_order(cases: Path, views: Path | None) -> None:
    """Tables in each other's place would be a fault a cell; they are told by their columns, and said once."""
    first = looks_like(cases, CaseRow, ViewRow)
    second = views is not None and looks_like(views, ViewRow, CaseRow)
    remedy = "give the table of the breasts first, then that of the mammograms"
    if first and second:
        raise FaultsError([Fault(f"{cases} and {views}", "these tables are swapped", remedy)])
    if first:
        what = "is given as cases, but is the table of the mammograms"
        raise FaultsError([Fault(str(cases), what, remedy)])
    if second:
        raise FaultsError([Fault(str(views), "is given as views, but is the table of the breasts", remedy)])


def _duplicates(path: Path, keys: Iterable[tuple[int, tuple[str, ...]]]) -> list[Fault]:
    first: dict[tuple[str, ...], int] = {}
    faults = []
    for number, key in keys:
        if first.setdefault(key, number) != number:
            what = f"{' '.join(key)} is already in row {first[key]}"
            faults.append(Fault(f"{path.name} row {number}", what, "keep one of the rows, or exclude one view"))
    return faults


def _orphans(path: Path, number: int, row: CaseRow) -> list[Fault]:
    """Columns that mean nothing without another one."""
    needs = {
        "mr_compressed_landmarks": ("mr_compressed", "mr_landmarks"),
        "mr_surface_points": ("mr_compressed_surface_points", "mr_compressed"),
        "mr_compressed_surface_points": ("mr_surface_points",),
    }
    return [
        Fault(f"{path.name} row {number} ({row.case})", f"{column} is given without {other}", f"give {other} as well")
        for column, others in needs.items()
        for other in others
        if getattr(row, column) and not getattr(row, other)
    ]


def _view_faults(path: Path, rows: Sequence[tuple[int, ViewRow]], cases: set[str], cases_name: str) -> list[Fault]:
    faults = _duplicates(path, [(n, (row.case, row.view)) for n, row in rows if not row.exclude])
    for number, row in rows:
        where = f"{path.name} row {number} ({row.case} {row.view})"
        if cases and row.case not in cases:
            faults.append(Fault(where, f"no case {row.case!r} in {cases_name}", "add it there or correct the id"))
        if row.image.suffix.lower() in PICTURES and row.pixel_spacing_mm is None:
            what = "a picture has no header, and the column pixel_spacing_mm is empty"
            faults.append(Fault(where, what, "give the pixel spacing at the detector in mm"))
    return faults
