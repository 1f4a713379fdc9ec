"""Preflight: opens every file that the tables name before the first job and lists all faults at once."""

from collections.abc import Callable, Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mammoreg.errors import DataError
from stages.cohort.cases import CaseRow, Cohort, ViewRow
from stages.cohort.readers.mammogram import is_picture, read_mammogram_facts
from stages.cohort.readers.mr_header import is_nifti, read_mr_grid
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
    """What is no fault but looks like something forgotten, a line each."""
    return [
        f"{cohort.cases_file.name} ({case.case}): has {' and '.join(marks)} but no view, so that nothing is predicted; "
        "add its mammograms to the table of views"
        for case in cohort.cases.values()
        if not cohort.views(case.case)
        and (marks := [c for c in ("mr_lesion", "mr_landmarks") if getattr(case, c) is not None])
    ]


class _Checked:
    """The files of one row that are there, and the checks of their contents."""

    def __init__(self, where: str, row: CaseRow | ViewRow, made: Collection[Path]) -> None:
        self.where = where
        self.files = {column: path for column, path in row.files().items() if path not in made}
        self.missing = [column for column, path in self.files.items() if not path.exists()]

    def case_faults(self, case: CaseRow) -> Iterator[Fault]:
        yield from self._missing_faults()
        for column in ("mr", "mr_compressed"):
            yield from self._fault(column, _check_mr)
        yield from self._fault("mr_lesion", lambda path: _check_mr_lesion(path, self.files.get("mr")))
        yield from self._fault("mr_labels", lambda path: _check_labels(path, self.files.get("mr")))
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


def _check_mr(path: Path) -> None:
    read_mr_grid(path)
    check_whole_mr(path)


def _check_mr_lesion(path: Path, mr: Path | None) -> None:
    if path.suffix == ".tsv":
        read_spheres(path)
        return
    _check_mask_name(path)
    _check_same_grid(path, mr)
    read_mask(path)


def _check_labels(path: Path, mr: Path | None) -> None:
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


def _check_same_grid(path: Path, mr: Path | None) -> None:
    grid = read_mr_grid(path)
    try:
        expected = read_mr_grid(mr) if mr and mr.exists() else grid
    except DataError:
        return  # the volume's own fault is listed already
    if not grid.same_as(expected):
        raise DataError(f"{path}: lies on another grid ({grid}) than mr ({expected}); resample it onto the MR grid")


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
