"""Files that mark places: landmarks and lesions in tables, lesion masks on the MR grid and on mammograms."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume

Vector = NDArray[np.float64]
_SEVERAL = "list several lesions in a .tsv instead, one row each"


def read_points(path: Path) -> dict[str, Vector]:
    """Points (3,) in LPS mm by name from a table `name x y z`."""
    return {name: np.array(numbers) for name, numbers in _rows(path, ("x", "y", "z")).items()}


def read_spheres(path: Path) -> dict[str, tuple[Vector, float]]:
    """Lesions as (centre (3,) in LPS mm, diameter in mm) by name from a table `name x y z diameter_mm`."""
    rows = _rows(path, ("x", "y", "z", "diameter_mm"))
    return {name: (np.array(n[:3]), _positive(path, name, n[3])) for name, n in rows.items()}


def read_pixels(path: Path) -> dict[str, Vector]:
    """Pixels (2,) as (column, row) by name from a table `name column row`."""
    return {name: np.array(numbers) for name, numbers in _rows(path, ("column", "row")).items()}


def read_discs(path: Path) -> dict[str, tuple[Vector, float]]:
    """Lesions as (pixel (2,) as (column, row), diameter in mm) by name from a table `name column row diameter_mm`."""
    rows = _rows(path, ("column", "row", "diameter_mm"))
    return {name: (np.array(n[:2]), _positive(path, name, n[2])) for name, n in rows.items()}


def read_image_mask(path: Path) -> NDArray[np.bool_]:
    """A lesion mask on a mammogram as stored, non-zero = lesion.

    Raises:
        DataError: the picture is unreadable, empty or has several components.
    """
    from PIL import Image

    try:
        with Image.open(path) as picture:
            pixels = np.asarray(picture)
    except OSError as error:
        raise DataError(f"{path}: cannot be read as a picture; write the mask again as .png") from error
    mask = pixels != 0
    # Of a colour picture with an opacity channel only the colours mark.
    mask = mask[..., : 1 if mask.shape[-1] == 2 else 3].any(axis=-1) if mask.ndim == 3 else mask
    _check_one_component(path, mask)
    return np.asarray(mask)


def read_mask(path: Path) -> Volume:
    """A lesion mask on the MR grid, LPS mm, non-zero = lesion.

    Raises:
        DataError: the file is unreadable, empty or has several components.
    """
    from stages.cohort.readers.mr import read_nifti

    volume = read_nifti(path)
    mask = np.nan_to_num(np.asarray(volume.data, dtype=float)) != 0
    _check_one_component(path, mask)
    return volume.with_data(mask)


def _check_one_component(path: Path, mask: NDArray[np.bool_]) -> None:
    from scipy import ndimage

    if not mask.any():
        raise DataError(f"{path}: the lesion mask is empty; mark the lesion or leave the cell empty")
    _, count = ndimage.label(mask, structure=np.ones((3,) * mask.ndim))
    if count > 1:
        raise DataError(f"{path}: the lesion mask has {count} components; {_SEVERAL}")


def _rows(path: Path, columns: tuple[str, ...]) -> dict[str, list[float]]:
    """Numbers by name from a tab-separated table whose header is `name` and these columns."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = list(csv.DictReader(file, delimiter="\t", restkey="more"))
            header = list(lines[0]) if lines else []
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: cannot be read as a tab-separated table") from error
    if not lines:
        raise DataError(f"{path}: the table is empty; give rows or leave the cell empty")
    if missing := [c for c in ("name", *columns) if c not in header]:
        raise DataError(f"{path}: no column {', '.join(missing)}; the columns are name, {', '.join(columns)}")
    found: dict[str, list[float]] = {}
    for number, line in enumerate(lines, start=2):
        name = (line["name"] or "").strip()
        if not name or name in found:
            raise DataError(f"{path}, line {number}: name {name!r} is {'given twice' if name else 'empty'}")
        found[name] = [_number(path, number, column, line[column]) for column in columns]
    return found


def _number(path: Path, line: int, column: str, text: Any) -> float:
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = float("nan")
    if not np.isfinite(value):
        raise DataError(f"{path}, line {line}, column {column}: {text!r} is no number")
    return value


def _positive(path: Path, name: str, diameter_mm: float) -> float:
    if diameter_mm <= 0:
        raise DataError(f"{path}, lesion {name}: diameter_mm must be positive, not {diameter_mm}")
    return diameter_mm
