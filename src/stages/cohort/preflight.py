"""Preflight: opens every file that the tables name before the first job and lists all faults at once."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.cases import CaseRow, Cohort, ViewRow
from stages.cohort.identity import strangers
from stages.cohort.mark_checks import (
    check_mr_lesion,
    check_mr_points,
    check_same_grid,
    check_same_names,
    check_view_landmarks,
    check_view_lesion,
)
from stages.cohort.readers.mammogram.image import image_size, is_picture, read_mammogram_facts
from stages.cohort.readers.marks.markups import UNKNOWN_DIAMETER_MM
from stages.cohort.readers.marks.points import is_list, without_diameter
from stages.cohort.readers.mr.choice import MrChoice
from stages.cohort.readers.mr.header import MrGrid, is_mr_dicom, is_nifti, read_mr_grid
from stages.cohort.readers.mr.volume import mr_choice, read_labels
from stages.cohort.readers.whole import check_whole_dicom, check_whole_mr, check_whole_picture
from stages.engine.errors import Fault

LABELS = range(5)


def check_cohort(cohort: Cohort, made: Collection[Path] = ()) -> list[Fault]:
    """All faults of the files that a cohort names, excluded rows apart.

    Args:
        cohort: what both tables say.
        made: files that the workflow makes itself; they are not looked at.
    """
    faults = []
    for case in cohort.cases.values():
        faults += list(_Checked(f"{cohort.cases_file.name} ({case.case})", case, made).case_faults(case))
    for view in cohort.mammograms.values():
        where = f"{cohort.views_file.name if cohort.views_file else ''} ({view.case} {view.view})"
        laterality = cohort.cases[view.case].laterality
        faults += list(_Checked(where, view, made).view_faults(view, laterality))
    remedy = "correct the table, or exclude the row"
    return faults + [Fault(where, what, remedy) for where, what, certain in strangers(cohort, made) if certain]


def warnings_of(cohort: Cohort) -> list[str]:
    """What is no fault but looks like something forgotten or is to be known, a line each."""
    odd = [
        f"{cohort.cases_file.name} ({case.case}): {what}"
        for case in cohort.cases.values()
        for what in _odd(cohort, case)
    ]
    return [
        *odd,
        *_view_notes(cohort),
        *(f"{where}: {note}" for where, choice in _mr_choices(cohort) for note in choice.notes),
        *(
            f"{where}: {what}; if they are of one woman all is well"
            for where, what, sure in strangers(cohort)
            if not sure
        ),
    ]


def _view_notes(cohort: Cohort) -> Iterator[str]:
    """What was noticed in reading the mammograms' headers; it stands in `trust` too."""
    for view in cohort.mammograms.values():
        try:
            facts = read_mammogram_facts(view.image, view.values(), cohort.cases[view.case].laterality, view.view)
        except DataError:
            continue  # a fault, which is listed
        where = f"{cohort.views_file.name if cohort.views_file else ''} ({view.case} {view.view})"
        yield from (f"{where}, column image: {flag}" for flag in facts.flags)


def choices_of(cohort: Cohort) -> list[str]:
    """Which MR series is taken of each folder, and why not the others, a line each."""
    return [
        line
        for where, choice in _mr_choices(cohort)
        for line in (f"{where}: {choice.taken}", *(f"  left: {what}: {why}" for what, why in choice.left))
    ]


def _mr_choices(cohort: Cohort) -> Iterator[tuple[str, MrChoice]]:
    """The choices of MR series, by table, case and column."""
    for case in cohort.cases.values():
        for column, path, series in (("mr", case.mr, case.mr_series), ("mr_compressed", case.mr_compressed, None)):
            choice = None if path is None else mr_choice(path, case.laterality, series or "")
            if choice is not None:
                yield f"{cohort.cases_file.name} ({case.case}), column {column}", choice


def _odd(cohort: Cohort, case: CaseRow) -> Iterator[str]:
    marks = [column for column in ("mr_lesion", "mr_landmarks") if getattr(case, column) is not None]
    if marks and not cohort.views(case.case):
        yield (
            f"has {' and '.join(marks)} but no view, so that nothing is predicted; "
            "add its mammograms to the table of views"
        )
    if case.mr_lesion is not None and is_list(case.mr_lesion) and (names := without_diameter(case.mr_lesion)):
        yield (
            f"mr_lesion gives {', '.join(names)} no diameter, and {UNKNOWN_DIAMETER_MM:g} mm is taken; "
            "write it into the point's description, or draw a line or closed curve"
        )


class _Checked:
    """The files of one row that are there, and the checks of their contents."""

    def __init__(self, where: str, row: CaseRow | ViewRow, made: Collection[Path]) -> None:
        self.where = where
        self.files = {column: path for column, path in row.files().items() if path not in made}
        self.missing = [column for column, path in self.files.items() if not path.exists()]

    def case_faults(self, case: CaseRow) -> Iterator[Fault]:
        yield from self._missing_faults()
        series = case.values().get("mr_series", "")
        yield from self._fault("mr", lambda path: _check_mr(path, case.laterality, series))
        yield from self._fault("mr_compressed", lambda path: _check_mr(path, case.laterality))
        mr = partial(self._grid, "mr", case.laterality, series)
        compressed = partial(self._grid, "mr_compressed", case.laterality)
        yield from self._fault("mr_lesion", lambda path: check_mr_lesion(path, mr()))
        yield from self._fault("mr_labels", lambda path: _check_labels(path, mr()))
        for column in ("mr_landmarks", "mr_surface_points"):
            yield from self._fault(column, lambda path: check_mr_points(path, mr()))
        for column in ("mr_compressed_landmarks", "mr_compressed_surface_points"):
            yield from self._fault(column, lambda path: check_mr_points(path, compressed()))
        for column, partner in (
            ("mr_compressed_landmarks", case.mr_landmarks),
            ("mr_compressed_surface_points", case.mr_surface_points),
        ):
            yield from self._fault(column, partial(check_same_names, partner=partner))

    def view_faults(self, view: ViewRow, laterality: Any) -> Iterator[Fault]:
        yield from self._missing_faults()
        yield from self._fault("image", lambda p: _check_image(p, view, laterality))
        size = partial(_size_of, self.files.get("image"))
        yield from self._fault("lesion", partial(check_view_lesion, size=size))
        yield from self._fault("landmarks", partial(check_view_landmarks, size=size))

    def _grid(self, column: str, side: Laterality, series: str = "") -> MrGrid | None:
        """Grid of a column's MR volume; None where there is none, or it has a fault, which is listed already."""
        if column not in self.files or column in self.missing:
            return None
        try:
            return read_mr_grid(self.files[column], side, series)
        except DataError:
            return None

    def _missing_faults(self) -> Iterator[Fault]:
        for column in self.missing:
            remedy = "correct the path, which is relative to the table's folder, or exclude the row"
            yield Fault(f"{self.where}, column {column}", f"there is no file {self.files[column]}", remedy)

    def _fault(self, column: str, check: Callable[[Path], Any]) -> Iterator[Fault]:
        if column not in self.files or column in self.missing:
            return
        try:
            check(self.files[column])
        except DataError as error:
            yield Fault(f"{self.where}, column {column}", str(error))


def _check_mr(path: Path, side: Laterality, series: str = "") -> None:
    if series and not is_mr_dicom(path):
        raise DataError(f"{path}: is one volume, and the column mr_series names a series; leave one of them out")
    read_mr_grid(path, side, series)
    check_whole_mr(path, side, series)


def _check_labels(path: Path, mr: MrGrid | None) -> None:
    if not is_nifti(path):
        raise DataError(f"{path}: is not NIfTI; give .nii.gz")
    check_same_grid(path, mr)
    found = np.unique(read_labels(path).data)
    if strange := [f"{value:.9g}" for value in found if value not in LABELS]:
        listed = ", ".join(strange[:5])
        raise DataError(
            f"{path}: holds the labels {listed}; known are 0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall"
        )
    if not {1, 2} & set(found.tolist()):
        raise DataError(f"{path}: labels neither fat (1) nor gland (2); give the breast's tissues or leave it empty")


def _check_image(path: Path, view: ViewRow, laterality: Any) -> None:
    facts = read_mammogram_facts(path, view.values(), laterality, view.view)
    if facts.pixel_mm is None:
        raise DataError(f"{path}: neither header nor table gives the pixel spacing; fill the column pixel_spacing_mm")
    (check_whole_picture if is_picture(path) else check_whole_dicom)(path)


def _size_of(image: Path | None) -> tuple[int, int] | None:
    """Rows and columns of a mammogram; None without one, or where it has a fault of its own."""
    try:
        return image_size(image) if image and image.exists() else None
    except DataError:
        return None
