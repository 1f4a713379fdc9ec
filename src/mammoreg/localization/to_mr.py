"""From the mammograms to the MR volume: where in the undeformed breast a lesion lies that views mark."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.localization.grid import BreastGrid, BreastInView, Cells
from mammoreg.localization.lesions import LesionArea

_CURVE_STEP_MM = 0.5
_STRETCH = 1.8
"""Bound of the stretch between the plates, by which coarse cells are kept for a closer look."""
DEPTH_UNKNOWN = "one view does not determine the depth of the lesion"
LEAST_CROSSING_DEG = 20.0
"""Below this an error across the beams is more than three times as large along them (chosen)."""
DEPTH_UNCERTAIN = "the beams run nearly alike and hardly determine the depth of the lesion"
_CELLS_ACROSS = 12
_FINEST_LEVEL = 3


@dataclass(frozen=True)
class MrPrediction:
    """A lesion of the mammograms in the undeformed breast; breast frame, mm.

    Attributes:
        point: its centre (3,).
        region: the intersection of the back-projected tubes, None if empty.
        curves: per view the beam through the lesion's centre, carried back, points (N, 3).
        beam_gap_mm: widest gap of two curves at their closest approach, None for one view.
        message: empty, or what a reader must know of it.
    """

    point: Points
    region: Volume | None
    curves: Mapping[str, Points]
    beam_gap_mm: float | None
    message: str


def locate_in_breast(views: Mapping[str, BreastInView], areas: Mapping[str, LesionArea]) -> MrPrediction:
    """Locate a lesion marked in one or several views.

    Of several views the point is the centroid of the region where the back-projected areas meet or, where they do not,
    the middle of the closest approach of the two beams that cross at the largest angle; of one view the middle of its
    curve.

    Args:
        views: by view name, all on one grid.
        areas: by view name, the lesion where it is marked; each name is in `views`.
    """
    names = list(areas)
    beams = {name: centre_curve(views[name], areas[name].centre) for name in names}
    curves = {name: curve for name, (curve, _) in beams.items()}
    notes = [
        f"the beam of {name} misses the breast's model by {miss:.1f} mm, its nearest part is used"
        for name, (_, miss) in beams.items()
        if miss > 0
    ]
    if len(names) == 1:
        notes.append(_depth_note(curves[names[0]]))
    region = back_projected_region([(views[name], areas[name]) for name in names])
    midpoint, gap = _beams_meet(list(curves.values()), _crossing_deg(views, names))
    point = midpoint
    if len(names) > 1 and (widest := float(_crossing_deg(views, names).max())) < LEAST_CROSSING_DEG:
        notes.append(f"{DEPTH_UNCERTAIN}: those of {' and '.join(names)} cross at {widest:.0f} degrees")
    if len(names) > 1 and region is None:
        notes.append("the back-projected tubes do not meet, the point is midway between the beams")
    elif len(names) > 1 and region is not None:
        point = region.centres(region.data).mean(axis=0)
    return MrPrediction(point, region, curves, gap, "; ".join(notes))


def _depth_note(curve: Points) -> str:
    length_mm = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())
    return f"{DEPTH_UNKNOWN}: it may lie anywhere on {length_mm:.0f} mm of the beam, the point is their middle"


def _crossing_deg(views: Mapping[str, BreastInView], names: Sequence[str]) -> NDArray[np.float64]:
    """Angles (N, N), 0 to 90 degrees, at which the beams of views cross; both directions of a beam are alike."""
    angles = np.array([views[name].method.geometry.angle_deg for name in names])
    turned = np.abs(angles[:, None] - angles[None, :]) % 180.0
    return np.asarray(np.minimum(turned, 180.0 - turned))


def _beams_meet(curves: list[Points], crossing_deg: NDArray[np.float64]) -> tuple[Points, float | None]:
    """Midway between the two curves that cross best and the widest gap; of one curve half its length, and None."""
    if len(curves) == 1:
        return halfway(curves[0]), None
    first, second = np.unravel_index(int(np.argmax(crossing_deg)), crossing_deg.shape)
    gaps = [closest_approach(a, b)[1] for a, b in combinations(curves, 2)]
    return closest_approach(curves[int(first)], curves[int(second)])[0], max(gaps)


def centre_curve(view: BreastInView, pixel: NDArray[np.float64]) -> tuple[Points, float]:
    """The beam to a pixel (column, row), carried into the undeformed breast.

    Returns:
        points (N, 3) inside the breast, breast frame, from the support to the source, and by how many mm, at the
        magnification of the plates' middle, the beam misses the breast; then the curve is the breast's nearest part.
    """
    geometry, heights = view.method.geometry, view.plate_points[:, 2]
    samples = np.arange(heights.min() - 5.0, heights.max() + 5.0, _CURVE_STEP_MM)
    beam = geometry.back_project(np.broadcast_to(pixel, (len(samples), 2)), samples)
    curve = view.method.deformation.inverse(beam)
    curve = curve[view.grid.holds(curve)]
    if len(curve):
        return curve, 0.0
    distance = np.linalg.norm(view.pixels - pixel, axis=1)
    nearest = int(np.argmin(distance))
    miss = float(distance[nearest]) * geometry.pixel_mm / geometry.middle_magnification
    return view.grid.block_centres[nearest : nearest + 1], miss


def halfway(curve: Points) -> Points:
    """The point (3,) at half the length of a polyline (N, 3)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    return np.array([np.interp(0.5 * length[-1], length, curve[:, axis]) for axis in range(3)])


def closest_approach(first: Points, second: Points) -> tuple[Points, float]:
    """Midway (3,) between two polylines (N, 3), (M, 3) where they come closest, and the gap there, mm."""
    a, b = first, second
    for _ in range(3):
        gap, partner = cKDTree(b).query(a)
        i = int(np.argmin(gap))
        j = int(np.asarray(partner)[i])
        pair = a[i], b[j]
        a, b = _around(a, i), _around(b, j)
    return 0.5 * (pair[0] + pair[1]), float(np.linalg.norm(pair[0] - pair[1]))


def _around(curve: Points, i: int) -> Points:
    """The polyline's two segments at vertex i, cut into twenty pieces each; the vertex stays one of them."""
    part = curve[max(i - 1, 0) : i + 2]
    parameter = np.linspace(0, len(part) - 1, 20 * (len(part) - 1) + 1)
    return np.stack([np.interp(parameter, np.arange(len(part)), part[:, axis]) for axis in range(3)], axis=1)


def back_projected_region(tubes: list[tuple[BreastInView, LesionArea]]) -> Volume | None:
    """The part of the undeformed breast whose projection falls into the lesion in every view.

    Blocks of voxels near all tubes are halved until a cell is at most a twelfth of the smallest lesion's diameter.

    Returns:
        a bool volume on halved voxels of the grid, cropped; None if no cell falls into all lesions.
    """
    grid, last = tubes[0][0].grid, _last_level(tubes)
    near = [_Nearness(view, area) for view, area in tubes]
    cells, level = grid.blocks, -1
    keep = _all_of([n.within(n.view.pixels, grid.spacing(-1)) for n in near])
    while level < last and keep.any():
        cells, level = grid.children(cells[keep], level), level + 1
        keep = _cells_kept(grid, cells, level, near, exact=level == last)
    return _volume_of(grid, cells[keep], level) if keep.any() else None


def _cells_kept(grid: BreastGrid, cells: Cells, level: int, near: list["_Nearness"], exact: bool) -> NDArray[np.bool_]:
    points = grid.centres(cells, level)
    pixels = [n.view.method.project(points) for n in near]
    if exact:
        return _all_of([n.area.contains(p) for n, p in zip(near, pixels, strict=True)])
    return _all_of([n.within(p, grid.spacing(level)) for n, p in zip(near, pixels, strict=True)])


def _all_of(tests: list[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    return np.asarray(np.all(tests, axis=0))


def _last_level(tubes: list[tuple[BreastInView, LesionArea]]) -> int:
    diameter = min(
        2.0 * np.sqrt(area.pixels / np.pi) * view.method.geometry.pixel_mm / view.method.geometry.middle_magnification
        for view, area in tubes
    )
    voxel = float(np.max(tubes[0][0].grid.breast.spacing))
    return int(np.clip(np.ceil(np.log2(voxel * _CELLS_ACROSS / diameter)), 1, _FINEST_LEVEL))


class _Nearness:
    """Whether positions on the detector are so near a lesion that a cell around them may reach into it."""

    def __init__(self, view: BreastInView, area: LesionArea) -> None:
        self.view, self.area = view, area
        margin = int(np.ceil(self._reach_px(view.grid.spacing(-1)))) + 1
        self._first = np.array(area.first) - margin
        self._distance = ndimage.distance_transform_edt(~np.pad(area.mask, margin))

    def _reach_px(self, spacing: NDArray[np.float64]) -> float:
        geometry = self.view.method.geometry
        half_diagonal = 0.5 * float(np.linalg.norm(spacing))
        return _STRETCH * half_diagonal * geometry.middle_magnification / geometry.pixel_mm + 1.0

    def within(self, pixels: NDArray[np.float64], spacing: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether cells of edges `spacing` (3,), mm, around positions (N, 2) may reach into the lesion."""
        index = np.rint(pixels).astype(np.intp) - self._first
        inside = np.all((index >= 0) & (index < self._distance.shape[::-1]), axis=1)
        inside[inside] = self._distance[index[inside, 1], index[inside, 0]] <= self._reach_px(spacing)
        return np.asarray(inside)


def _volume_of(grid: BreastGrid, cells: Cells, level: int) -> Volume:
    low = cells.min(axis=0)
    data = np.zeros(tuple(cells.max(axis=0) - low + 1), dtype=bool)
    data[tuple((cells - low).T)] = True
    return Volume(data, grid.centres(low, level), grid.spacing(level), grid.breast.frame)
