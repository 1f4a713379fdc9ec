"""Curves on the skin from the back's rim to the nipple, each at one angle around the breast."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import LinearNDInterpolator
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.errors import DataError
from mammoreg.meshing.surface import BreastSurface, triangle_edges

# Largest distance of the pole from the apex, as a share of the radius of a half sphere of the skin's area.
_POLE_REACH = 0.25
# Largest gap, radians, between neighbouring rim vertices as seen from the rim's middle.
_WIDEST_GAP = 1.0


@dataclass(frozen=True)
class Meridians:
    """The skin as a map from (angle, fraction of the way from the nipple to the rim).

    Attributes:
        angles: M angles, radians, equally spaced over a full turn from -pi on, in the plane (medial, superior) scaled
            to equal half widths.
        curves: (M, S, 3) points in mm, equally spaced along each curve from the nipple to the rim.
    """

    angles: Floats
    curves: Floats

    def at(self, angle: Floats, fraction: Floats) -> Floats:
        """Points (..., 3) at angles and fractions (0 nipple, 1 rim) of one shape, bilinear between the curves."""
        count, samples = self.curves.shape[:2]
        a = (np.asarray(angle) - self.angles[0]) / (2.0 * np.pi) * count
        s = np.clip(fraction, 0.0, 1.0) * (samples - 1)
        a0, s0 = np.floor(a).astype(int), np.minimum(np.floor(s).astype(int), samples - 2)
        fa, fs = (a - a0)[..., None], (s - s0)[..., None]
        low, high = a0 % count, (a0 + 1) % count
        first = (1.0 - fs) * self.curves[low, s0] + fs * self.curves[low, s0 + 1]
        second = (1.0 - fs) * self.curves[high, s0] + fs * self.curves[high, s0 + 1]
        return np.asarray((1.0 - fa) * first + fa * second)


def skin_meridians(surface: BreastSurface, nipple: Floats, count: int = 128, samples: int = 81) -> Meridians:
    """Trace meridians through a harmonic map of the skin to the unit disc.

    The map (Tutte's, with cotangent weights) exists whatever the breast's shape, pendulous or bent, where rays from a
    point or planes across an axis may meet the skin twice.
    """
    used, flat = np.unique(surface.skin_triangles, return_inverse=True)
    triangles = flat.reshape(-1, 3)
    vertices = surface.vertices[used]
    disc, apex = _map_to_disc(vertices, triangles)
    lift = LinearNDInterpolator(disc, vertices)
    reach = _POLE_REACH * np.sqrt(_area(vertices, triangles) / (2.0 * np.pi))
    middle = _pole(lift, apex, disc[np.linalg.norm(vertices - nipple, axis=1).argmin()], reach)
    angles = -np.pi + 2.0 * np.pi * np.arange(count) / count
    ends = 0.999 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # Far from the rim a harmonic map shrinks exponentially: sample densely towards the nipple.
    fraction = np.concatenate([[0.0], np.geomspace(0.002, 1.0, 4 * samples)])
    places = middle + fraction[None, :, None] * (ends - middle)[:, None, :]
    traced = lift(places)
    # Between two rim vertices the circle lies outside their chord.
    beyond = np.isnan(traced).any(axis=-1)
    traced[beyond] = vertices[cKDTree(disc).query(places[beyond])[1]]
    return Meridians(angles, np.stack([_resample(curve, samples) for curve in traced]))


def _pole(lift: LinearNDInterpolator, apex: Floats, nipple: Floats, reach: float) -> Floats:
    """The place (2,) in the disc where meridians meet: the nipple, or as far from the apex towards it as allowed.

    Squeezed in the coil, some breasts carry the nipple on their flank; a pole there would make slivers of the
    elements between it and the rim.
    """
    line = apex + np.linspace(0.0, 1.0, 200)[:, None] * (nipple - apex)
    way = np.cumsum(np.linalg.norm(np.diff(lift(line), axis=0), axis=1))
    return np.asarray(line[np.searchsorted(way, reach)])


def _map_to_disc(vertices: Floats, triangles: Integers) -> tuple[Floats, Floats]:
    """Harmonic map (V, 2) with the rim at its angles around the rim's middle on the unit circle, and the apex (2,).

    The apex is where the solution of Poisson's equation, zero at the rim, is largest: far from the rim on all sides.
    """
    rim = _rim_vertices(triangles)
    around = vertices[rim][:, [0, 2]]
    low, high = around.min(axis=0), around.max(axis=0)
    around = (around - 0.5 * (low + high)) / (high - low)
    turns = np.sort(np.arctan2(around[:, 1], around[:, 0]))
    if np.diff(turns, append=turns[0] + 2.0 * np.pi).max() > _WIDEST_GAP:
        raise DataError("the breast mask's skin does not end in one rim around the chest-wall surface: check both")
    disc = np.zeros((len(vertices), 2))
    disc[rim] = around / np.linalg.norm(around, axis=1, keepdims=True)
    free = np.setdiff1d(np.arange(len(vertices)), rim)
    matrix = _cotangent_laplacian(vertices, triangles)[free]
    factor = splu(matrix[:, free].tocsc())
    disc[free] = factor.solve(-(matrix[:, rim] @ disc[rim]))
    depth = factor.solve(_vertex_areas(vertices, triangles)[free])
    top = depth > 0.995 * depth.max()
    return disc, disc[free][top].mean(axis=0)


def _area(vertices: Floats, triangles: Integers) -> float:
    return float(_vertex_areas(vertices, triangles).sum())


def _vertex_areas(vertices: Floats, triangles: Integers) -> Floats:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(third, 3), minlength=len(vertices))
    return np.asarray(areas, dtype=float)


def _rim_vertices(triangles: Integers) -> Integers:
    """Vertices of the longest border; shorter ones are holes and stay free."""
    edges = np.sort(triangle_edges(triangles), axis=1)
    count = int(triangles.max()) + 1
    _, first, uses = np.unique(edges[:, 0] * count + edges[:, 1], return_index=True, return_counts=True)
    border = edges[first[uses == 1]]
    graph = sparse.coo_array((np.ones(len(border)), (border[:, 0], border[:, 1])), shape=(count, count))
    _, loop = connected_components(graph, directed=False)
    longest = np.bincount(loop[border[:, 0]]).argmax()
    return np.unique(border[loop[border[:, 0]] == longest])


def _cotangent_laplacian(vertices: Floats, triangles: Integers) -> sparse.csr_array:
    """Laplacian (V, V) with cotangent weights, kept positive so that no triangle of the map turns over."""
    count = len(vertices)
    total = sparse.csr_array((count, count))
    for corner in range(3):
        a, b, c = (triangles[:, (corner + shift) % 3] for shift in range(3))
        u, v = vertices[b] - vertices[a], vertices[c] - vertices[a]
        sine = np.linalg.norm(np.cross(u, v), axis=1)
        cotangent = np.clip((u * v).sum(axis=1) / np.maximum(sine, 1e-9), 0.02, 5.0)
        total = total + sparse.coo_array((cotangent, (b, c)), shape=(count, count)).tocsr()
    weights = total + total.T
    return sparse.csr_array(sparse.diags_array(weights.sum(axis=1)) - weights)


def _resample(curve: Floats, samples: int) -> Floats:
    """A polyline (K, 3) as `samples` points equally spaced along it."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    places = np.linspace(0.0, length[-1], samples)
    return np.stack([np.interp(places, length, curve[:, axis]) for axis in range(3)], axis=1)
