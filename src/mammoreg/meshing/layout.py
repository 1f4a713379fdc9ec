"""Where the edges of the block lie on the skin, and the first mesh made from them."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.meridians import Meridians
from mammoreg.meshing.transfinite import fill_block, fill_face

_EDGE_ANGLES = np.deg2rad([-135.0, -45.0, 45.0, 135.0])
_EDGE_WINDOW = np.deg2rad(40.0)
_SOFTNESS_MM = 1.5
_CAP_PRIOR = (0.36, 0.07)


def first_mesh(meridians: Meridians, n: int) -> BlockMesh:
    """Block of n elements a side with nodes on the skin, filled by transfinite interpolation.

    The long edges lie where the cross-sections around the curved axis reach farthest in the diagonal directions of
    the patient's axes: at +-45 and +-135 degrees on a round breast, and on the rounded ends, not the flat flanks, of
    a narrow one. The cap's border likewise lies where skin turns from facing sideways to facing the front.
    """
    axis = curved_axis(meridians)
    m = n + 1
    block = np.zeros((m, m, m, 3))
    ring = _square_ring(n)
    border = cap_border(meridians, axis)
    for k in range(m):
        progress = k / n
        angle = _ring_angles(meridians, edge_angles(meridians, axis), border, progress, n)
        fraction = 1.0 - progress * (1.0 - _at_angle(border, angle))
        block[ring[:, 0], ring[:, 1], k] = meridians.at(angle, fraction)
    block[:, :, n] = _cap(meridians, angle, fraction, ring, n)
    block[:, :, 0] = fill_face(block[:, :, 0])
    return BlockMesh(n, fill_block(block).transpose(2, 1, 0, 3).reshape(-1, 3))


def curved_axis(meridians: Meridians) -> tuple[Floats, Floats]:
    """Middles (S, 3) of the rings of equal fraction, smoothed, and frames (S, 3, 3) with rows medial, superior, front.

    Samples run from the nipple to the rim, as in `Meridians.curves`.
    """
    curves = meridians.curves
    pieces = np.linalg.norm(np.roll(curves, -1, axis=0) - np.roll(curves, 1, axis=0), axis=2) + 1e-6
    middles = np.einsum("ms,msc->sc", pieces, curves) / pieces.sum(axis=0)[:, None]
    fraction = np.linspace(0.0, 1.0, middles.shape[0])
    polynomial = np.polynomial.polynomial.polyfit(fraction, middles, 3)
    smooth = np.polynomial.polynomial.polyval(fraction, polynomial).T
    front = -np.polynomial.polynomial.polyval(fraction, np.polynomial.polynomial.polyder(polynomial)).T
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    medial = np.array([1.0, 0.0, 0.0]) - front[:, :1] * front
    medial /= np.linalg.norm(medial, axis=1, keepdims=True)
    return np.asarray(smooth), np.stack([medial, np.cross(front, medial), front], axis=1)


def edge_angles(meridians: Meridians, axis: tuple[Floats, Floats]) -> Floats:
    """Coefficients (3, 4), quadratic in the fraction, of the angles of the long edges, from -135 to 135 degrees."""
    middles, frames = axis
    local = np.einsum("sdc,msc->msd", frames, meridians.curves - middles)[..., :2]
    half = np.ptp(local, axis=0).max(axis=0) / 2.0
    samples = np.arange(int(0.3 * len(middles)), len(middles))
    found = []
    for nominal in _EDGE_ANGLES:
        direction = np.sign([np.cos(nominal), np.sin(nominal)]) / np.sqrt(half)
        reach = local[:, samples] @ (direction / np.linalg.norm(direction))
        offset = _wrapped(meridians.angles - nominal)
        found.append(nominal + _soft_argmax(reach, np.where(np.abs(offset) < _EDGE_WINDOW, offset, np.nan)[:, None]))
    fraction = samples / (len(middles) - 1)
    return np.asarray(np.polynomial.polynomial.polyfit(fraction, np.stack(found, axis=1), 2))


def cap_border(meridians: Meridians, axis: tuple[Floats, Floats]) -> Floats:
    """Fourier coefficients (5,), up to the second order, of the fraction at which each meridian enters the cap."""
    middles, frames = axis
    count = len(middles)
    near = count // 3
    local = (meridians.curves - middles[near]) @ frames[near].T
    radial = local[:, near, :2] / np.linalg.norm(local[:, near, :2], axis=1, keepdims=True)
    outward = np.einsum("msd,md->ms", local[..., :2], radial)
    width, depth = outward.max(), np.ptp(local[..., 2])
    reach = (outward / np.sqrt(width) + local[..., 2] / np.sqrt(depth)) * np.sqrt(0.5 * min(width, depth))
    fraction = np.linspace(0.0, 1.0, count)
    mean, deviation = _CAP_PRIOR
    reach = reach - 0.5 * _SOFTNESS_MM * ((fraction - mean) / deviation) ** 2
    found = _soft_argmax(reach.T, fraction[:, None])
    return np.asarray(np.linalg.lstsq(_fourier(meridians.angles), found, rcond=None)[0])


def _soft_argmax(score: Floats, position: Floats) -> Floats:
    """Mean along the first axis of positions weighted by exp(score / softness); nan positions do not count."""
    allowed = ~np.isnan(position) & np.ones(score.shape, dtype=bool)
    best = np.where(allowed, score, -np.inf).max(axis=0)
    weight = np.where(allowed, np.exp(np.minimum((score - best) / _SOFTNESS_MM, 0.0)), 0.0)
    return np.asarray((weight * np.nan_to_num(position)).sum(axis=0) / weight.sum(axis=0))


def _wrapped(angle: Floats) -> Floats:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _fourier(angle: Floats) -> Floats:
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=-1)


def _at_angle(coefficients: Floats, angle: Floats) -> Floats:
    return np.asarray(_fourier(angle) @ coefficients)


def _square_ring(n: int) -> NDArray[np.int64]:
    """Places (4 n, 2) around the border of an (n + 1)^2 square, from (0, 0) anticlockwise."""
    run = np.arange(n)
    low, high = np.zeros_like(run), np.full_like(run, n)
    sides = [(run, low), (high, run), (n - run, high), (low, n - run)]
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def _ring_angles(meridians: Meridians, edges: Floats, border: Floats, progress: float, n: int) -> Floats:
    """Angles (4 n,) of the nodes of one ring: corners on the edges, between them at equal distances on the skin."""
    corners = np.asarray(np.polynomial.polynomial.polyval(1.0 - progress * (1.0 - border[0]), edges))
    ends = np.append(corners, corners[0] + 2.0 * np.pi)
    angles = []
    for start, end in pairwise(ends):
        fine = np.linspace(start, end, 12 * n + 1)
        fraction = 1.0 - progress * (1.0 - _at_angle(border, fine))
        steps = np.linalg.norm(np.diff(meridians.at(fine, fraction), axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        angles.append(np.interp(np.arange(n) / n * length[-1], length, fine))
    return np.concatenate(angles)


def _cap(meridians: Meridians, angle: Floats, fraction: Floats, ring: NDArray[np.int64], n: int) -> Floats:
    """Nodes (n + 1, n + 1, 3) of the cap, filled in the plane of polar coordinates (fraction, angle)."""
    plane = np.zeros((n + 1, n + 1, 3))
    plane[ring[:, 0], ring[:, 1], :2] = (fraction * np.stack([np.cos(angle), np.sin(angle)])).T
    plane = fill_face(plane)
    return meridians.at(np.arctan2(plane[..., 1], plane[..., 0]), np.hypot(plane[..., 0], plane[..., 1]))
