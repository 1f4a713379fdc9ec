"""What `check` sees of the users' marks: whether the files can be read, and lie where their image does."""

from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from stages.cohort.readers.marks.masks import read_image_mask, read_masks
from stages.cohort.readers.marks.points import is_list, read_discs, read_pixels, read_points, read_spheres
from stages.cohort.readers.mr.header import MrGrid, is_nifti, read_mr_grid

BORDER_MM = 2.0
"""A mark may lie this far, or one voxel, beyond the outermost voxel centres."""
_NAMED = 3

Vector = NDArray[np.float64]


def check_mr_lesion(path: Path, mr: MrGrid | None) -> None:
    """Raises DataError: unreadable, no lesion, on another grid, or outside the volume."""
    if is_list(path):
        centres = {name: centre for name, (centre, _) in read_spheres(path).items()}
    else:
        if is_nifti(path):
            check_same_grid(path, mr)
        centres = {name: mask.centres(mask.data).mean(axis=0) for name, mask in read_masks(path).items()}
    _check_inside(path, centres, mr)


def check_mr_points(path: Path, mr: MrGrid | None) -> None:
    """Raises DataError: unreadable, or points outside the volume."""
    _check_inside(path, read_points(path), mr)


def check_same_names(path: Path, partner: Path | None) -> None:
    """Raises DataError: corresponding points have no name in common."""
    names = set(read_points(path))
    try:
        others = set(read_points(partner)) if partner and partner.exists() else names
    except DataError:
        return
    if not names & others:
        raise DataError(f"{path}: shares no name with {partner}; give corresponding points the same names")


def check_same_grid(path: Path, mr: MrGrid | None) -> None:
    """Raises DataError: a mask or map of labels lies on another grid than the volume."""
    grid = read_mr_grid(path)
    if mr is None or grid.same_as(mr):
        return
    shift = grid.shift_to(mr)
    if shift is not None:
        listed = ", ".join(f"{x + 0.0:.2f}" for x in np.round(-shift, 2))
        what = f"lies on another grid than mr: the same voxels, but ({listed}) mm off (LPS)"
    else:
        what = f"lies on another grid ({grid}) than mr ({mr})"
    raise DataError(f"{path}: {what}; resample it onto the MR grid")


def check_view_lesion(path: Path, size: Callable[[], tuple[int, int] | None]) -> None:
    """Raises DataError: unreadable, no lesion, or off the picture, whose rows and columns `size` gives."""
    if is_list(path):
        _check_on_picture(path, {name: pixel for name, (pixel, _) in read_discs(path).items()}, size())
        return
    mask, expected = read_image_mask(path), size()
    if expected is not None and mask.shape != expected:
        raise DataError(
            f"{path}: the mask has {mask.shape[0]} x {mask.shape[1]} pixels (rows x columns), "
            f"its mammogram {expected[0]} x {expected[1]}; draw it on the image as stored"
        )


def check_view_landmarks(path: Path, size: Callable[[], tuple[int, int] | None]) -> None:
    """Raises DataError: unreadable, or off the picture."""
    _check_on_picture(path, read_pixels(path), size())


def _check_inside(path: Path, places: Mapping[str, Vector], grid: MrGrid | None) -> None:
    if grid is None:
        return
    points = np.array(list(places.values()))
    inside = _inside(points, grid)
    if inside.all():
        return
    low, high = grid.corners.min(axis=0), grid.corners.max(axis=0)
    spans = ", ".join(f"{axis} {a:.0f} to {b:.0f}" for axis, a, b in zip("xyz", low, high, strict=True))
    outside = _listed([name for name, known in zip(places, inside, strict=True) if not known])
    raise DataError(f"{path}: {outside} outside the MR volume ({spans} mm, LPS); {_remedy(points, grid)}")


def _inside(points: Vector, grid: MrGrid) -> NDArray[np.bool_]:
    index, last = grid.index(points), np.array(grid.shape) - 1
    border = np.maximum(1.0, BORDER_MM / np.array(grid.spacing))
    return np.asarray(np.all((index >= -border) & (index <= last + border), axis=1))


def _remedy(points: Vector, grid: MrGrid) -> str:
    """Which axes negated would put all marks inside: LPS and RAS differ in x and y."""
    for signs in sorted(product((1.0, -1.0), repeat=3), key=lambda s: s != (-1.0, -1.0, 1.0)):
        if min(signs) < 0.0 and _inside(points * np.array(signs), grid).all():
            negated = " and ".join(axis for axis, sign in zip("xyz", signs, strict=True) if sign < 0.0)
            frame = ", so they seem to be RAS" if signs == (-1.0, -1.0, 1.0) else ""
            return f"with {negated} negated all lie inside{frame}: give LPS coordinates"
    return "give LPS coordinates in mm in the frame of this volume"


def _check_on_picture(path: Path, places: Mapping[str, Vector], size: tuple[int, int] | None) -> None:
    if size is None:
        return
    rows, columns = size
    pixels, ends = np.array(list(places.values())), np.array([columns, rows])
    on = _on(pixels, ends)
    if on.all():
        return
    outside = _listed([name for name, known in zip(places, on, strict=True) if not known])
    remedy = "give column and row of the image as stored, in pixels, the first pixel being 0 0"
    if _on(pixels[:, ::-1], ends).all():
        remedy = f"with column and row exchanged all lie on it: {remedy}"
    raise DataError(f"{path}: {outside} outside the picture ({columns} columns, {rows} rows); {remedy}")


def _on(pixels: Vector, ends: NDArray[np.int_]) -> NDArray[np.bool_]:
    return np.asarray(np.all((pixels >= -0.5) & (pixels <= ends - 0.5), axis=1))


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:_NAMED])
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{shown}{more} lie{'s' if len(names) == 1 else ''}"
