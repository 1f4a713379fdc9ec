"""What users mark, as numerics see it: the MR volume's marks in LPS, a mammogram's in canonical pixels.

A canonical image has the chest wall at column 0 and its rows run towards medial.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Points
from mammoreg.localization.lesions import (
    LesionArea,
    MaskLesion,
    MrLesion,
    SphereLesion,
    area_from_disc,
    area_from_mask,
)
from mammoreg.metrics.distances import breast_scale_mm
from stages.cohort.readers.points import read_discs, read_image_mask, read_mask, read_pixels, read_points, read_spheres
from stages.engine.artefact import Array, Artefact
from stages.engine.contract import Inputs
from stages.methods import view_geometry

MASK_NAME = "lesion"


def canonical_pixels(pose: Artefact, stored: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (..., 2) as (column, row) of the canonical image from those of the stored one."""
    size, flip, scale = _storage(pose)
    pixels = np.asarray(stored, dtype=float)
    flipped = np.where(flip, size - 1 - pixels, pixels)
    return np.asarray((flipped + 0.5) * scale - 0.5)


def stored_pixels(pose: Artefact, canonical: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (..., 2) as (column, row) of the stored image from those of the canonical one."""
    size, flip, scale = _storage(pose)
    pixels = (np.asarray(canonical, dtype=float) + 0.5) / scale - 0.5
    return np.asarray(np.where(flip, size - 1 - pixels, pixels))


def canonical_image(pose: Artefact, stored: NDArray[Any]) -> NDArray[Any]:
    """A stored mask turned into the canonical one; each canonical pixel takes the stored one under its centre."""
    columns, rows = np.arange(int(pose.value("columns"))), np.arange(int(pose.value("rows")))
    from_columns = stored_pixels(pose, np.stack([columns, np.zeros_like(columns)], axis=1))[:, 0]
    from_rows = stored_pixels(pose, np.stack([np.zeros_like(rows), rows], axis=1))[:, 1]
    return np.asarray(stored[np.ix_(np.rint(from_rows).astype(np.intp), np.rint(from_columns).astype(np.intp))])


def _storage(pose: Artefact) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Stored size, flips and canonical pixels per stored one, each as (column, row)."""
    size = np.array([pose.value("stored_columns"), pose.value("stored_rows")], dtype=float)
    flip = np.array([pose.value("flip_columns"), pose.value("flip_rows")], dtype=bool)
    return size, flip, np.array([pose.value("columns"), pose.value("rows")], dtype=float) / size


def mr_landmarks(inputs: Inputs, name: str = "mr_landmarks") -> dict[str, Points]:
    """Landmarks (3,) of an input file by name, LPS mm; none without the file."""
    path = inputs.path(name)
    return {} if path is None else read_points(path)


def mr_lesions(inputs: Inputs) -> dict[str, MrLesion]:
    """Lesions of `mr_lesion` by name, LPS mm; none without the file."""
    path = inputs.path("mr_lesion")
    if path is None:
        return {}
    if path.suffix == ".tsv":
        return {name: SphereLesion(centre, diameter) for name, (centre, diameter) in read_spheres(path).items()}
    return {MASK_NAME: MaskLesion(read_mask(path))}


def mr_lesion_names(inputs: Inputs) -> list[str]:
    """Names of the lesions of `mr_lesion`; a mask is not opened for that."""
    path = inputs.path("mr_lesion")
    if path is None:
        return []
    return list(read_spheres(path)) if path.suffix == ".tsv" else [MASK_NAME]


def view_landmarks(inputs: Inputs, view: str) -> dict[str, NDArray[np.float64]]:
    """Landmarks of a mammogram by name, stored pixels (column, row); none without the file."""
    path = inputs.path(f"landmarks_{view}")
    return {} if path is None else read_pixels(path)


def view_lesion_names(inputs: Inputs, view: str) -> list[str]:
    """Names of the lesions marked in a mammogram."""
    path = inputs.path(f"lesion_{view}")
    if path is None:
        return []
    return list(read_discs(path)) if path.suffix == ".tsv" else [MASK_NAME]


def view_areas(inputs: Inputs, pose: Artefact) -> dict[str, LesionArea]:
    """Lesions marked in a view's mammogram by name, canonical pixels; none without the file."""
    path = inputs.path(f"lesion_{pose.view}")
    if path is None:
        return {}
    if path.suffix != ".tsv":
        mask, size = read_image_mask(path), (pose.value("stored_rows"), pose.value("stored_columns"))
        if mask.shape != size:
            raise DataError(
                f"{path}: the mask has {mask.shape} rows and columns, its mammogram {size}; draw it on the image"
            )
        return {MASK_NAME: area_from_mask(canonical_image(pose, mask))}
    per_mm = 1.0 / breast_scale_mm(view_geometry(pose))
    found = {}
    for name, (pixel, diameter_mm) in read_discs(path).items():
        column, row = canonical_pixels(pose, pixel)
        found[name] = area_from_disc(float(column), float(row), diameter_mm * per_mm)
    return found


def area_field(area: LesionArea, long_name: str) -> tuple[Array, list[int]]:
    """A predicted area as an artefact's array, and its first (column, row)."""
    return Array(area.mask, "1", f"{long_name}, canonical pixels"), list(area.first)


def read_area(artefact: Artefact, name: str, first: list[int]) -> LesionArea:
    """The area that `area_field` stored."""
    return LesionArea(artefact.array(name, "1") != 0, (first[0], first[1]))
