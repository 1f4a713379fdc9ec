"""What users mark, as numerics see it: in the MR volume in LPS, in a mammogram in canonical pixels.

A canonical image has the chest wall at column 0 and its rows run along the plate frame's first axis.
"""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.errors import DataError
from mammoreg.localization.lesions import (
    LesionArea,
    MaskLesion,
    MrLesion,
    SphereLesion,
    area_from_disc,
    area_from_mask,
)
from mammoreg.localization.outside import distance_outside_px
from mammoreg.metrics.distances import breast_scale_mm
from stages.cohort.readers.marks.masks import mask_names, read_image_mask, read_masks
from stages.cohort.readers.marks.points import MASK_NAME, is_list, read_discs, read_pixels, read_points, read_spheres
from stages.engine.contract import Inputs
from stages.pose.record import PoseRecord

IMAGE_AIR_MM = 3.0
"""Marks in a mammogram's air this far from the breast are flagged; those of sound cases lie in the breast."""


def mr_landmarks(inputs: Inputs, name: str = "mr_landmarks") -> dict[str, Points]:
    """Landmarks (3,) of an input file by name, LPS mm; none without the file."""
    path = inputs.path(name)
    return {} if path is None else read_points(path)


def mr_lesions(inputs: Inputs) -> dict[str, MrLesion]:
    """Lesions of `mr_lesion` by name, LPS mm; none without the file."""
    path = inputs.path("mr_lesion")
    if path is None:
        return {}
    if is_list(path):
        return {name: SphereLesion(centre, diameter) for name, (centre, diameter) in read_spheres(path).items()}
    return {name: MaskLesion(mask) for name, mask in read_masks(path).items()}


def mr_lesion_names(inputs: Inputs) -> list[str]:
    """Names of the lesions of `mr_lesion`; a NIfTI mask is not opened for that."""
    path = inputs.path("mr_lesion")
    if path is None:
        return []
    return list(read_spheres(path)) if is_list(path) else mask_names(path)


def view_landmarks(inputs: Inputs, view: str) -> dict[str, NDArray[np.float64]]:
    """Landmarks of a mammogram by name, stored pixels (column, row); none without the file."""
    path = inputs.path(f"landmarks_{view}")
    return {} if path is None else read_pixels(path)


def view_lesion_names(inputs: Inputs, view: str) -> list[str]:
    """Names of the lesions marked in a mammogram."""
    path = inputs.path(f"lesion_{view}")
    if path is None:
        return []
    return list(read_discs(path)) if is_list(path) else [MASK_NAME]


def view_areas(inputs: Inputs, pose: PoseRecord) -> dict[str, LesionArea]:
    """Lesions marked in a view's mammogram by name, canonical pixels; none without the file."""
    path = inputs.path(f"lesion_{pose.view}")
    if path is None:
        return {}
    if not is_list(path):
        mask, size = read_image_mask(path), (pose.storage.rows, pose.storage.columns)
        if mask.shape != size:
            raise DataError(
                f"{path}: the mask has {mask.shape} rows and columns, its mammogram {size}; draw it on the image"
            )
        return {MASK_NAME: area_from_mask(pose.canonical_image(mask))}
    per_mm = 1.0 / breast_scale_mm(pose.geometry)
    found = {}
    for name, (pixel, diameter_mm) in read_discs(path).items():
        column, row = pose.canonical_pixels(pixel)
        found[name] = area_from_disc(float(column), float(row), diameter_mm * per_mm)
    return found


def landmarks_in_air(inputs: Inputs, pose: PoseRecord) -> list[str]:
    """Names of a mammogram's landmarks that lie in its air."""
    if not pose.has_mammogram:
        return []
    breast, limit_px = pose.tissue != 0, IMAGE_AIR_MM / breast_scale_mm(pose.geometry)
    places = {name: pose.canonical_pixels(pixel) for name, pixel in view_landmarks(inputs, pose.view).items()}
    return [name for name, pixel in places.items() if distance_outside_px(pixel, breast) > limit_px]
