"""Silhouette of a surface as a radial function, for comparison with the outline in a mammogram.

A compressed breast is star-shaped about a point on the image's chest-wall edge, so its silhouette is a radius over the
angle from the forward direction. The radius of a faceted surface is exact: the largest crossing of a ray with the
surface's projected edges, because the silhouette of facets consists of edges.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry

MARGIN_DEG = 1.0  # rays stay this far from the chest-wall edge, along which a crossing is ill-conditioned


@dataclass(frozen=True)
class Silhouette:
    """Radial silhouette about a centre on the chest-wall edge.

    Attributes:
        centre_along_mm: place of the centre along the chest wall, from the image's middle row, at the detector.
        theta: angles (K,) of the rays from forward towards medial, rad, increasing.
        radius: distances (K,) at the detector, mm; nan where no edge crosses the ray.
        edge_nodes: the two surface nodes (K, 2) whose edge realises the silhouette, -1 where there is none.
        edge_weight: share (K,) of the second node at the crossing.
    """

    centre_along_mm: float
    theta: NDArray[np.float64]
    radius: NDArray[np.float64]
    edge_nodes: NDArray[np.intp]
    edge_weight: NDArray[np.float64]

    def points(self) -> NDArray[np.float64]:
        """The silhouette (K, 2) as (forward, along) at the detector, mm."""
        return polar_to_detector(self.theta, self.radius, self.centre_along_mm)

    def between(self, marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Rays (K,) on which an edge between two of the marked surface nodes (N,) makes the silhouette."""
        return np.asarray((self.edge_nodes[:, 0] >= 0) & marked[self.edge_nodes].all(axis=1))


def polar_to_detector(
    theta: NDArray[np.float64], radius: NDArray[np.float64], centre_along_mm: float
) -> NDArray[np.float64]:
    """Points (K, 2) as (forward, along), mm, of polar coordinates about a centre on the chest-wall edge."""
    return np.stack([radius * np.cos(theta), centre_along_mm + radius * np.sin(theta)], axis=-1)


def detector_mm(points: Points, view: ViewGeometry) -> NDArray[np.float64]:
    """Project points (..., 3) of the plate frame to (..., 2) forward of the edge and along it, mm at the detector."""
    return pixels_at_detector(view.project(points), view)


def pixels_at_detector(pixels: NDArray[np.float64], view: ViewGeometry) -> NDArray[np.float64]:
    """Canonical pixels (..., 2) as (column, row) to (..., 2) forward of the edge and along it, mm at the detector."""
    forward = (pixels[..., 0] + 0.5) * view.pixel_mm
    along = (pixels[..., 1] - 0.5 * (view.rows - 1)) * view.pixel_mm
    return np.stack([forward, along], axis=-1)


def ray_angles(count: int) -> NDArray[np.float64]:
    """Angles (count,) in rad of rays over the half plane in front of the chest-wall edge."""
    limit = np.deg2rad(90.0 - MARGIN_DEG)
    return np.linspace(-limit, limit, count)


def quad_edges(quads: NDArray[np.intp]) -> NDArray[np.intp]:
    """The distinct edges (E, 2) of quadrilaterals (Q, 4), and one diagonal of each."""
    pairs = np.concatenate([quads[:, [0, 1]], quads[:, [1, 2]], quads[:, [2, 3]], quads[:, [3, 0]], quads[:, [0, 2]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def silhouette(
    detector_points: NDArray[np.float64], edges: NDArray[np.intp], centre_along_mm: float, theta: NDArray[np.float64]
) -> Silhouette:
    """Silhouette of surface edges.

    Args:
        detector_points: projected surface nodes (N, 2) as (forward, along), mm.
        edges: node pairs (E, 2).
        centre_along_mm: centre of the rays along the chest-wall edge.
        theta: equidistant increasing ray angles (K,), rad, within (-pi/2, pi/2).

    Returns:
        The largest crossing on each ray; nan where no edge crosses it.
    """
    relative = detector_points - np.array([0.0, centre_along_mm])
    angle = np.arctan2(relative[:, 1], relative[:, 0])
    first, last = angle[edges[:, 0]], angle[edges[:, 1]]
    swap = first > last
    ordered = np.where(swap[:, None], edges[:, ::-1], edges)
    low, high = np.minimum(first, last), np.maximum(first, last)
    start = np.searchsorted(theta, low)
    count = np.where(high - low < np.pi, np.searchsorted(theta, high, side="right") - start, 0)
    edge = np.repeat(np.arange(len(edges)), count)
    offset = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    ray = np.repeat(start, count) + offset
    radius, weight = _crossings(relative[ordered[edge, 0]], relative[ordered[edge, 1]], theta[ray])
    return _largest(radius, weight, ray, ordered[edge], centre_along_mm, theta)


def _crossings(
    a: NDArray[np.float64], b: NDArray[np.float64], theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    normal = np.stack([-np.sin(theta), np.cos(theta)], axis=-1)
    height_a = np.einsum("ki,ki->k", a, normal)
    height_b = np.einsum("ki,ki->k", b, normal)
    drop = height_a - height_b
    weight = np.clip(np.divide(height_a, drop, out=np.zeros_like(drop), where=drop != 0.0), 0.0, 1.0)
    crossing = a + weight[:, None] * (b - a)
    return np.hypot(crossing[:, 0], crossing[:, 1]), weight


def _largest(
    radius: NDArray[np.float64],
    weight: NDArray[np.float64],
    ray: NDArray[np.intp],
    nodes: NDArray[np.intp],
    centre_along_mm: float,
    theta: NDArray[np.float64],
) -> Silhouette:
    order = np.lexsort((radius, ray))
    last = np.flatnonzero(np.append(np.diff(ray[order]) != 0, True)) if len(order) else np.zeros(0, dtype=np.intp)
    best = order[last]
    result = Silhouette(
        centre_along_mm,
        theta,
        np.full(len(theta), np.nan),
        np.full((len(theta), 2), -1, dtype=np.intp),
        np.zeros(len(theta)),
    )
    result.radius[ray[best]] = radius[best]
    result.edge_nodes[ray[best]] = nodes[best]
    result.edge_weight[ray[best]] = weight[best]
    return result
