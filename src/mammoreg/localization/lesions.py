"""Lesions as both modalities mark them: a body in the MR volume, an area on the detector."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, lps_to_breast
from mammoreg.geometry.frames import Laterality

_MOST_POINTS = 20_000
_FINEST_STEP_MM = 0.25


@dataclass(frozen=True)
class LesionBody:
    """A lesion in the MR volume, as points that fill it evenly.

    Attributes:
        points: (N, 3), mm, in the frame of what it was made from.
        step_mm: distance of neighbouring points.
        centre: centroid (3,), mm.
    """

    points: Points
    step_mm: float
    centre: Points


@dataclass(frozen=True)
class MaskLesion:
    """A lesion of the MR volume as a mask (non-zero = lesion), and its body."""

    mask: Volume

    @property
    def centre(self) -> Points:
        """Centroid (3,) of the mask's voxels, mm."""
        return np.asarray(self.mask.centres(np.asarray(self.mask.data) != 0).mean(axis=0))

    @property
    def volume_mm3(self) -> float:
        """Volume of the mask's voxels."""
        return float(np.count_nonzero(self.mask.data)) * self.mask.voxel_mm3

    def to_breast(self, laterality: Laterality) -> "MaskLesion":
        """The lesion in the other of the two frames."""
        return MaskLesion(self.mask.to_breast(laterality))

    def body(self) -> LesionBody:
        """Points that fill the mask."""
        return body_from_mask(self.mask)

    def contains(self, points: Points) -> NDArray[np.bool_]:
        """Whether points (N, 3), mm, lie in one of the mask's voxels."""
        index = np.rint(self.mask.to_index(points)).astype(np.intp)
        found = np.all((index >= 0) & (index < self.mask.shape), axis=1)
        found[found] = np.asarray(self.mask.data)[tuple(index[found].T)] != 0
        return np.asarray(found)


@dataclass(frozen=True)
class SphereLesion:
    """A lesion of the MR volume as centre (3,) and diameter, mm."""

    centre: Points
    diameter_mm: float

    @property
    def volume_mm3(self) -> float:
        """Volume of the sphere."""
        return float(np.pi / 6.0 * self.diameter_mm**3)

    def to_breast(self, laterality: Laterality) -> "SphereLesion":
        """The lesion in the other of the two frames."""
        return SphereLesion(lps_to_breast(self.centre, laterality), self.diameter_mm)

    def body(self) -> LesionBody:
        """Points that fill the sphere."""
        return body_from_sphere(self.centre, self.diameter_mm)

    def contains(self, points: Points) -> NDArray[np.bool_]:
        """Whether points (N, 3), mm, lie in the sphere."""
        return np.asarray(np.linalg.norm(points - self.centre, axis=1) <= 0.5 * self.diameter_mm)


MrLesion = MaskLesion | SphereLesion


@dataclass(frozen=True)
class LesionArea:
    """A lesion in a mammogram: a mask over a part of the canonical image.

    Attributes:
        mask: (rows, columns) of the part, bool.
        first: (column, row) of the part's first pixel in the whole image; negative beyond the image's border.
    """

    mask: NDArray[np.bool_]
    first: tuple[int, int]

    @property
    def centre(self) -> NDArray[np.float64]:
        """Centroid (column, row) of the pixels in the whole image."""
        rows, columns = np.nonzero(self.mask)
        return np.asarray([columns.mean() + self.first[0], rows.mean() + self.first[1]])

    @property
    def pixels(self) -> int:
        """Number of pixels inside."""
        return int(np.count_nonzero(self.mask))

    def contains(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether positions (N, 2) as (column, row) lie on one of the lesion's pixels."""
        index = np.rint(pixels).astype(np.intp) - np.array(self.first)
        size = np.array(self.mask.shape[::-1])
        within = np.all((index >= 0) & (index < size), axis=1)
        found = np.zeros(len(index), dtype=bool)
        found[within] = self.mask[index[within, 1], index[within, 0]]
        return found

    def on_image(self, rows: int, columns: int) -> NDArray[np.bool_]:
        """The mask on the whole image; what lies beyond the border is cut off."""
        image = np.zeros((rows, columns), dtype=bool)
        column, row = self.first
        height, width = self.mask.shape
        top, left = max(row, 0), max(column, 0)
        bottom, right = max(min(row + height, rows), top), max(min(column + width, columns), left)
        image[top:bottom, left:right] = self.mask[top - row : bottom - row, left - column : right - column]
        return image


def body_from_mask(mask: Volume) -> LesionBody:
    """Fill a lesion mask (non-zero = lesion) with points: the half level of the linearly interpolated mask.

    Raises:
        ValueError: if the mask is empty.
    """
    selected = np.asarray(mask.data) != 0
    voxels = np.argwhere(selected)
    if len(voxels) == 0:
        raise ValueError("the lesion mask is empty")
    low, high = np.maximum(voxels.min(0) - 1, 0), voxels.max(0) + 2
    part = selected[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
    step = max((len(voxels) * mask.voxel_mm3 / _MOST_POINTS) ** (1 / 3), _FINEST_STEP_MM)
    parts = np.maximum(np.ceil(mask.spacing / step), 1).astype(int)
    axes = [(np.arange(n * k) + 0.5) / k - 0.5 for n, k in zip(part.shape, parts, strict=True)]
    index = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    origin = mask.to_world(low)
    crop = Volume(part.astype(np.float32), origin, mask.spacing, mask.frame)
    points = crop.to_world(index)
    points = points[crop.sample(points) >= 0.5]
    return LesionBody(points, float(np.max(mask.spacing / parts)), mask.centres(selected).mean(axis=0))


def body_from_sphere(centre: Points, diameter_mm: float) -> LesionBody:
    """Fill a sphere with points.

    Raises:
        ValueError: if the diameter is not positive.
    """
    if not diameter_mm > 0:
        raise ValueError(f"a lesion's diameter must be positive, not {diameter_mm} mm")
    step = max(diameter_mm / 24, min(_FINEST_STEP_MM, diameter_mm / 8))
    half = int(np.ceil(0.5 * diameter_mm / step))
    axis = np.arange(-half, half + 1) * step
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.linalg.norm(grid, axis=1) <= 0.5 * diameter_mm]
    return LesionBody(np.asarray(centre, dtype=float) + grid, step, np.asarray(centre, dtype=float))


def area_from_mask(mask: NDArray[np.bool_]) -> LesionArea:
    """The lesion of a mask on the whole canonical image.

    Raises:
        ValueError: if the mask is empty.
    """
    rows, columns = np.nonzero(mask)
    if len(rows) == 0:
        raise ValueError("the lesion mask is empty")
    top, left = int(rows.min()), int(columns.min())
    return LesionArea(mask[top : rows.max() + 1, left : columns.max() + 1] != 0, (left, top))


def area_from_disc(column: float, row: float, diameter_px: float) -> LesionArea:
    """A disc, at least the pixel under its centre.

    Raises:
        ValueError: if the diameter is not positive.
    """
    if not diameter_px > 0:
        raise ValueError(f"a lesion's diameter must be positive, not {diameter_px} pixels")
    centre = np.array([column, row], dtype=float)
    first = np.floor(centre - 0.5 * diameter_px).astype(int)
    last = np.ceil(centre + 0.5 * diameter_px).astype(int)
    columns, rows = np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1)
    distance = np.hypot(columns[None, :] - column, rows[:, None] - row)
    mask = (distance <= 0.5 * diameter_px) | (distance <= distance.min())
    return LesionArea(mask, (int(first[0]), int(first[1])))
