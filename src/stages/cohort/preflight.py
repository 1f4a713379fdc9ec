"""Preflight: opens every file that the tables name before the first job and lists all faults at once."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from stages.cohort.cases import CaseRow, Cohort, ViewRow
from stages.cohort.readers.mammogram import is_picture, read_mammogram_facts
from stages.cohort.readers.mr import mr_choice
from stages.cohort.readers.mr_choice import MrChoice
from stages.cohort.readers.mr_header import MrGrid, is_mr_dicom, is_nifti, read_mr_grid
from stages.cohort.readers.points import read_discs, read_image_mask, read_mask, read_pixels, read_points, read_spheres
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
    return faults


def warnings_of(cohort: Cohort) -> list[str]:
    """What is no fault but looks like something forgotten or is to be known, a line each."""
    forgotten = [
        f"{cohort.cases_file.name} ({case.case}): has {' and '.join(marks)} but no view, so that nothing is predicted; "
        "add its mammograms to the table of views"
        for case in cohort.cases.values()
        if not cohort.views(case.case)
        and (marks := [c for c in ("mr_lesion", "mr_landmarks") if getattr(case, c) is not None])
    ]
    return [
        *forgotten,
        *(f"{where}: {note}" for where, choice in _mr_choices(cohort) for note in choice.notes),
    ]


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
        mr = partial(self._mr_grid, case.laterality, series)
        yield from self._fault("mr_lesion", lambda path: _check_mr_lesion(path, mr()))
        yield from self._fault("mr_labels", lambda path: _check_labels(path, mr()))
        for column in ("mr_landmarks", "mr_surface_points"):
            yield from self._fault(column, read_points)
        for column, partner in (
            ("mr_compressed_landmarks", case.mr_landmarks),
            ("mr_compressed_surface_points", case.mr_surface_points),
        ):
            yield from self._fault(column, partial(_check_same_names, partner=partner))

    def view_faults(self, view: ViewRow, laterality: Any) -> Iterator[Fault]:
        yield from self._missing_faults()
        yield from self._fault("image", lambda p: _check_image(p, view, laterality))
        yield from self._fault("lesion", lambda p: _check_view_lesion(p, self.files.get("image")))
        yield from self._fault("landmarks", read_pixels)

    def _mr_grid(self, side: Laterality, series: str) -> MrGrid | None:
        """Grid of the case's MR volume; None where it has a fault, which is listed already."""
        if "mr" not in self.files or "mr" in self.missing:
            return None
        try:
            return read_mr_grid(self.files["mr"], side, series)
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


def _check_mr_lesion(path: Path, mr: MrGrid | None) -> None:
    if path.suffix == ".tsv":
        read_spheres(path)
        return
    _check_mask_name(path)
    _check_same_grid(path, mr)
    read_mask(path)


def _check_labels(path: Path, mr: MrGrid | None) -> None:
    _check_mask_name(path)
    _check_same_grid(path, mr)
    import nibabel

    try:
        image: Any = nibabel.load(path)
        found = np.unique(np.asanyarray(image.dataobj))
    except (OSError, EOFError, ValueError) as error:
        raise DataError(f"{path}: cannot be read; export the labels again") from error
    if strange := [f"{value:g}" for value in found if value not in LABELS]:
        listed = ", ".join(strange[:5])
        raise DataError(
            f"{path}: holds the labels {listed}; known are 0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall"
        )
    if not {1, 2} & set(found.tolist()):
        raise DataError(f"{path}: labels neither fat (1) nor gland (2); give the breast's tissues or leave it empty")


def _check_mask_name(path: Path) -> None:
    if not is_nifti(path):
        raise DataError(f"{path}: is not NIfTI; give .nii.gz (for a lesion also a .tsv with name x y z diameter_mm)")


def _check_same_grid(path: Path, mr: MrGrid | None) -> None:
    grid = read_mr_grid(path)
    if mr is not None and not grid.same_as(mr):
        raise DataError(f"{path}: lies on another grid ({grid}) than mr ({mr}); resample it onto the MR grid")


def _check_same_names(path: Path, partner: Path | None) -> None:
    names = set(read_points(path))
    try:
        others = set(read_points(partner)) if partner and partner.exists() else names
    except DataError:
        return
    if not names & others:
        raise DataError(f"{path}: shares no name with {partner}; give corresponding points the same names")


def _check_image(path: Path, view: ViewRow, laterality: Any) -> None:
    facts = read_mammogram_facts(path, view.values(), laterality, view.view)
    if facts.pixel_mm is None:
        raise DataError(f"{path}: neither header nor table gives the pixel spacing; fill the column pixel_spacing_mm")
    _image_size(path)
    (check_whole_picture if is_picture(path) else check_whole_dicom)(path)


def _check_view_lesion(path: Path, image: Path | None) -> None:
    if path.suffix == ".tsv":
        read_discs(path)
        return
    mask = read_image_mask(path)
    try:
        size = _image_size(image) if image and image.exists() else mask.shape
    except DataError:
        return
    if mask.shape != size:
        raise DataError(
            f"{path}: the mask has {mask.shape[0]} x {mask.shape[1]} pixels (rows x columns), "
            f"its mammogram {image} {size[0]} x {size[1]}; draw it on the image as stored"
        )


def _image_size(path: Path) -> tuple[int, int]:
    """Rows and columns of a mammogram."""
    if is_picture(path):
        from PIL import Image, UnidentifiedImageError

        try:
            with Image.open(path) as picture:
                return picture.height, picture.width
        except (OSError, UnidentifiedImageError) as error:
            raise DataError(f"{path}: cannot be read as a picture; export the image again") from error
    from pydicom import dcmread
    from pydicom.errors import InvalidDicomError

    try:
        header = dcmread(path, stop_before_pixels=True)
        return int(header.Rows), int(header.Columns)
    except (OSError, InvalidDicomError, AttributeError, TypeError, ValueError) as error:
        raise DataError(f"{path}: the header gives no image size; export the image again") from error
