"""The outline in a mammogram, as the silhouettes of models are compared with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.pose.silhouette import Silhouette, polar_to_detector, quad_edges, silhouette


@dataclass(frozen=True)
class RadialOutline:
    """An outline in an image as a radius about a centre on the chest-wall edge, mm at the detector.

    Attributes:
        centre_along_mm: place of the centre along the chest wall, from the image's middle row.
        theta: equidistant ray angles (K,), rad.
        radius: distances (K,), nan where the image shows no outline.
        weight: trust (K,) in [0, 1]: 1 where the outline is skin, 0 where it is not or is missing.
        normal: outward unit normals (K, 2) as (forward, along).
    """

    centre_along_mm: float
    theta: NDArray[np.float64]
    radius: NDArray[np.float64]
    weight: NDArray[np.float64]
    normal: NDArray[np.float64]

    def points(self) -> NDArray[np.float64]:
        """The outline (K, 2) as (forward, along) at the detector, mm."""
        return polar_to_detector(self.theta, self.radius, self.centre_along_mm)

    def normal_gap(self, model: Silhouette) -> NDArray[np.float64]:
        """Signed distance (K,) along the outline's normal, mm: positive where the outline lies outside the model."""
        ray = np.stack([np.cos(self.theta), np.sin(self.theta)], axis=-1)
        return np.asarray((self.radius - model.radius) * np.einsum("ki,ki->k", ray, self.normal))

    def of_model(self, detector_points: NDArray[np.float64], quads: NDArray[np.intp]) -> Silhouette:
        """Silhouette of a projected surface (N, 2) with quads (Q, 4) on the rays of this outline."""
        return silhouette(detector_points, quad_edges(quads), self.centre_along_mm, self.theta)


def radial_outline(
    points: NDArray[np.float64], weight: NDArray[np.float64], theta: NDArray[np.float64]
) -> RadialOutline:
    """Express an outline polyline (M, 2) as (forward, along), mm at the detector, by rays (K,) in rad.

    The centre is the middle of the outline's extent along the chest wall. `weight` (M,) is interpolated along it.
    """
    centre = 0.5 * float(points[:, 1].min() + points[:, 1].max())
    segments = np.stack([np.arange(len(points) - 1), np.arange(1, len(points))], axis=-1)
    crossing = silhouette(points, segments, centre, theta)
    share = crossing.edge_weight
    found = crossing.edge_nodes[:, 0] >= 0
    trust = (1.0 - share) * weight[crossing.edge_nodes[:, 0]] + share * weight[crossing.edge_nodes[:, 1]]
    trust = np.where(found, trust, 0.0)
    return RadialOutline(centre, theta, crossing.radius, trust, _normals(crossing))


def _normals(outline: Silhouette) -> NDArray[np.float64]:
    points = outline.points()
    tangent = np.gradient(points, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    ray = np.stack([np.cos(outline.theta), np.sin(outline.theta)], axis=-1)
    return np.where(np.isfinite(length) & (length > 0), normal / np.where(length > 0, length, 1.0), ray)
