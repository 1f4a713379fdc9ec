"""A rigid compression plate as a signed distance function in the plate frame (medial, posterior, height)."""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.errors import DataError

FLAT = 1e9
"""Posterior coordinate, mm, of the edge of a plate without end."""


@dataclass(frozen=True)
class Gap:
    """Distance to a plate at points (...,): positive outside.

    Attributes:
        distance: (...,), mm.
        normal: unit vectors (..., 3) pointing out of the plate.
        curvature: (...,), 1/mm, of the surface across the lip, zero elsewhere.
    """

    distance: Floats
    normal: Floats
    curvature: Floats

    def hessian(self) -> Floats:
        """Second derivative of the distance (..., 3, 3), 1/mm."""
        across = np.zeros_like(self.normal)
        across[..., 1], across[..., 2] = -self.normal[..., 2], self.normal[..., 1]
        return np.asarray(self.curvature[..., None, None] * across[..., :, None] * across[..., None, :])


@dataclass(frozen=True)
class Plate:
    """A plate that fills everything beyond `height_mm` and in front of `edge_p_mm`, its corner rounded.

    Attributes:
        height_mm: height of its flat face.
        facing: +1 for the lower plate (its face looks up), -1 for the upper.
        edge_p_mm: posterior coordinate where it ends towards the chest wall; None: without end.
        lip_radius_mm: radius of the rounded lip at that end.
    """

    height_mm: float
    facing: int
    edge_p_mm: float | None = None
    lip_radius_mm: float = 5.0

    def gap(self, points: Floats) -> Gap:
        """Distance of points (..., 3), mm, its gradient and curvature; continuous gradient outside and on the face."""
        edge = FLAT if self.edge_p_mm is None else self.edge_p_mm
        radius = self.lip_radius_mm
        across = points[..., 1] - (edge - radius)
        above = self.facing * (points[..., 2] - self.height_mm) + radius
        length = np.hypot(np.maximum(across, 0.0), np.maximum(above, 0.0))
        rounded = (across > 0.0) & (above > 0.0)
        safe = np.where(rounded, length, 1.0)
        wall = ~rounded & (across > above)
        normal = np.zeros((*across.shape, 3))
        normal[..., 1] = np.where(rounded, across / safe, wall)
        normal[..., 2] = self.facing * np.where(rounded, above / safe, ~wall)
        distance = np.where(rounded, length, np.maximum(across, above)) - radius
        return Gap(distance, normal, np.where(rounded, 1.0 / safe, 0.0))

    def first_touch(self, points: Floats) -> float:
        """Height, mm, of the face at which the plate, coming from afar, first touches one of the points (N, 3).

        Raises:
            DataError: the plate ends in front of all of them.
        """
        edge = FLAT if self.edge_p_mm is None else self.edge_p_mm
        across = np.maximum(points[:, 1] - (edge - self.lip_radius_mm), 0.0)
        front = across < self.lip_radius_mm
        if not front.any():
            raise DataError(f"no point lies in front of the plate's edge at posterior coordinate {edge:.1f} mm")
        drop = self.lip_radius_mm - np.sqrt(self.lip_radius_mm**2 - across[front] ** 2)
        return float(self.facing * (self.facing * points[front, 2] + drop).min())
