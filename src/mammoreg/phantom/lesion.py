"""The lesion of a digital patient: an irregular, spiculated ellipsoid, and the rule that places it."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from mammoreg.phantom.shape import Array, BreastShape

SPICULES = 9
SPICULE_ANGLE_RAD = 0.22
SPICULE_REACH = 0.4
EDGE_MM = 1.2
TRIES = 10000


@dataclass(frozen=True)
class Lesion:
    """An irregular ellipsoid.

    Attributes:
        centre: (3,), breast frame, mm.
        half_axes: (3,) along medial, posterior, superior, mm.
        spicules: unit directions (S, 3) in which it reaches out.
    """

    centre: Array
    half_axes: Array
    spicules: Array

    @property
    def reach_mm(self) -> float:
        """No part lies farther from the centre than this."""
        return float(self.half_axes.max()) * (1.0 + SPICULE_REACH) + EDGE_MM

    def share(self, points: Array) -> Array:
        """How much of the tissue at points (N, 3) is lesion, 0 to 1, soft over about a millimetre."""
        offset = (points - self.centre) / self.half_axes
        distance = np.linalg.norm(offset, axis=1)
        direction = offset / np.maximum(distance, 1e-9)[:, None]
        angle = np.arccos(np.clip((direction @ self.spicules.T).max(axis=1), -1.0, 1.0))
        edge = 1.0 + SPICULE_REACH * np.exp(-((angle / SPICULE_ANGLE_RAD) ** 2))
        scale = float(np.cbrt(self.half_axes.prod()))
        return np.asarray(np.clip((edge - distance) * scale / EDGE_MM + 0.5, 0.0, 1.0))


@dataclass(frozen=True)
class LesionRule:
    """Where and how large a lesion may be; the first draw that fits is taken and never exchanged.

    Attributes:
        diameter_mm: least and largest mean diameter.
        skin_mm: least distance of its surface from the skin.
        back_mm: least distance of its surface from the surface where the breast is tied to the chest.
        nipple_mm: least distance of its centre from the nipple.
        aside_mm: least distance of its centre, along medial, from the nipple.
        off_axis: least and largest share of the way from the breast's axis to the skin.
    """

    diameter_mm: tuple[float, float]
    skin_mm: float
    back_mm: float
    nipple_mm: float
    aside_mm: float
    off_axis: tuple[float, float]

    def draw(self, shape: BreastShape, random: Generator) -> Lesion:
        """Draw sizes and places together until one fits.

        Raises:
            ValueError: none of `TRIES` places fits; the rule asks for more room than the breast has.
        """
        stretch = random.uniform(0.85, 1.2, size=3)
        unit = stretch / np.cbrt(stretch.prod())
        spicules = random.standard_normal((SPICULES, 3))
        spicules /= np.linalg.norm(spicules, axis=1, keepdims=True)
        for _ in range(TRIES):
            half_axes = 0.5 * random.uniform(*self.diameter_mm) * unit
            place = draw_inside(shape, random)
            if self._fits(shape, place, float(half_axes.max())):
                return Lesion(place, half_axes, spicules)
        raise ValueError("no place in the breast fits the lesion: loosen the rule's distances or enlarge the breast")

    def _fits(self, shape: BreastShape, place: Array, radius: float) -> bool:
        m, p, s = place
        return bool(
            self.off_axis[0] <= shape.breast_ratio(m, p, s) <= self.off_axis[1]
            and shape.level(m, p, s) >= radius + self.skin_mm
            and shape.back(m, s) - p >= radius + self.back_mm
            and np.linalg.norm(place - shape.nipple) >= self.nipple_mm
            and abs(m - shape.nipple[0]) >= self.aside_mm
        )


def draw_inside(shape: BreastShape, random: Generator) -> Array:
    """A random point (3,) in front of the back and inside the skin, uniform in volume."""
    lowest = np.array([shape.centre_m - 1.5 * shape.lateral, shape.tip[1], shape.centre_s - 1.5 * shape.inferior])
    highest = np.array(
        [shape.centre_m + 1.5 * shape.medial, shape.base_p + 40.0, shape.centre_s + 1.5 * shape.superior]
    )
    while True:
        point = random.uniform(lowest, highest)
        if shape.level(*point) > 0.0 and point[1] < shape.back(point[0], point[2]):
            return point


def draw_landmarks(
    shape: BreastShape, random: Generator, count: int, skin_mm: float, back_mm: float, apart_mm: float
) -> Array:
    """Landmarks (count, 3) in mm, none nearer to skin, back or another one than given; first come, first kept."""
    kept: list[Array] = []
    for _ in range(2 * TRIES):
        point = draw_inside(shape, random)
        deep = shape.level(*point) >= skin_mm and shape.back(point[0], point[2]) - point[1] >= back_mm
        if deep and all(np.linalg.norm(point - other) >= apart_mm for other in kept):
            kept.append(point)
        if len(kept) == count:
            return np.array(kept)
    raise ValueError(f"only {len(kept)} of {count} landmarks fit: lessen their distance from each other")
