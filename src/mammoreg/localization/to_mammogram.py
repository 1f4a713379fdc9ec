"""From the MR volume to the mammogram: where each view shows what is marked in the MR volume."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.lesions import LesionArea, LesionBody


@dataclass(frozen=True)
class ProjectedLesion:
    """A lesion of the MR volume on the detector.

    Attributes:
        area: the projected area, cut at the image's border; None where nothing of it is imaged.
        centre: centroid (column, row) of the area's pixels, canonical image; without them of the whole projection.
        seen: whether the centroid of the whole projection lies in the image.
    """

    area: LesionArea | None
    centre: NDArray[np.float64]
    seen: bool


def in_image(pixels: NDArray[np.float64], geometry: ViewGeometry) -> NDArray[np.bool_]:
    """Whether positions (N, 2) as (column, row) lie in the image, so in front of its chest-wall edge too."""
    size = np.array([geometry.columns, geometry.rows])
    return np.asarray(np.all(np.isfinite(pixels) & (pixels >= -0.5) & (pixels < size - 0.5), axis=-1))


def project_landmarks(method: MethodView, points_breast: Points) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Pixels (N, 2) as (column, row) of landmarks (N, 3), breast frame, mm, and whether each is in the image."""
    if len(points_breast) == 0:
        return np.zeros((0, 2)), np.zeros(0, dtype=bool)
    pixels = method.project(points_breast)
    return pixels, in_image(pixels, method.geometry)


def project_lesion(method: MethodView, body: LesionBody) -> ProjectedLesion:
    """Project a lesion's body (breast frame) through the deformed breast onto the detector."""
    pixels = method.project(body.points)
    geometry = method.geometry
    step_px = body.step_mm * geometry.middle_magnification / geometry.pixel_mm
    whole = fill_area(pixels, step_px)
    image = whole.on_image(geometry.rows, geometry.columns)
    if not image.any():
        return ProjectedLesion(None, whole.centre, False)
    rows, columns = np.nonzero(image)
    top, left = int(rows.min()), int(columns.min())
    area = LesionArea(image[top : rows.max() + 1, left : columns.max() + 1], (left, top))
    return ProjectedLesion(area, area.centre, bool(in_image(whole.centre, geometry)))


def fill_area(pixels: NDArray[np.float64], step_px: float) -> LesionArea:
    """The area that points (N, 2) about `step_px` apart cover: discs around them, shrunk back (a closing).

    Every point stands for a cell, so that the outline lies half a step outside the outermost points.
    """
    reach = max(1.5 * step_px, 1.5)
    margin = int(np.ceil(2 * reach)) + 1
    index = np.rint(pixels).astype(np.intp)
    first = index.min(axis=0) - margin
    size = index.max(axis=0) + margin + 1 - first
    empty = np.ones((size[1], size[0]), dtype=bool)
    empty[index[:, 1] - first[1], index[:, 0] - first[0]] = False
    grown = ndimage.distance_transform_edt(empty) <= reach
    mask = ndimage.distance_transform_edt(grown) > reach - 0.5 * step_px + 0.5
    if not mask.any():
        mask = ~empty
    return LesionArea(mask, (int(first[0]), int(first[1])))
