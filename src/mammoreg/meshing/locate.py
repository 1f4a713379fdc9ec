"""Location of points in hexahedra by inversion of the trilinear map."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.meshing.trilinear import CORNERS, shape_functions

_EXTRAPOLATION = 1.5
_SAMPLES_A_SIDE = 4
_NEAREST_SAMPLES = 24
_TOLERANCE_MM = 1e-4


class Locator:
    """Finds element and local coordinates of points in a hexahedral mesh.

    A tree over sample points of every element gives the candidates and Newton's starting values; Newton then inverts
    the trilinear map for all points at once.
    """

    def __init__(self, mesh_points: Floats, hexes: Integers) -> None:
        """Prepare a mesh of nodes (M, 3), mm, and hexahedra (E, 8) in VTK order."""
        nodes = np.asarray(mesh_points, dtype=float)[hexes]
        self._coefficients = _monomial_coefficients(nodes)
        side = (np.arange(_SAMPLES_A_SIDE) + 0.5) * (2.0 / _SAMPLES_A_SIDE) - 1.0
        self._samples = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
        positions = np.einsum("qa,eac->eqc", shape_functions(self._samples), nodes, optimize=True)
        self._tree = cKDTree(positions.reshape(-1, 3))
        # No point inside an element is farther than this from its samples, however skewed it is.
        self._reach = 2.0 / _SAMPLES_A_SIDE * float(np.linalg.norm(np.ptp(nodes, axis=1), axis=1).max())

    def locate(self, points: Floats) -> tuple[Integers, Floats, NDArray[np.bool_]]:
        """Element (N,), local coordinates (N, 3) and whether it lies inside (N,) for each of points (N, 3) in mm.

        Points outside get the nearest element, with local coordinates extrapolated up to 1.5 times its half width.
        """
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        away, nearest = self._tree.query(points)
        element, start = self._candidate(np.asarray(nearest, dtype=np.int64))
        local = self._invert(points, element, start)
        inside = self._holds(points, element, local)
        rest = np.flatnonzero(~inside & (away <= self._reach))
        if len(rest):
            element[rest], local[rest] = self._best_of_candidates(points[rest], element[rest], local[rest])
            inside[rest] = self._holds(points[rest], element[rest], local[rest])
        return element, np.clip(local, -_EXTRAPOLATION, _EXTRAPOLATION), inside

    def _candidate(self, sample: Integers) -> tuple[Integers, Floats]:
        """Element and local coordinates of numbered samples."""
        per_element = len(self._samples)
        return sample // per_element, self._samples[sample % per_element].copy()

    def _holds(self, points: Floats, element: Integers, local: Floats) -> NDArray[np.bool_]:
        """Whether the element itself comes to the point (Newton may have stopped outside, or elsewhere)."""
        return self._distance(points, element, local) < _TOLERANCE_MM

    def _best_of_candidates(self, points: Floats, element: Integers, local: Floats) -> tuple[Integers, Floats]:
        """Try the elements of further near samples; keep for each point the one that comes nearest to it."""
        best_element, best_local = element.copy(), local.copy()
        gap = self._distance(points, element, local)
        _, nearest = self._tree.query(points, k=min(_NEAREST_SAMPLES, self._tree.n))
        candidates, starts = self._candidate(np.asarray(nearest, dtype=np.int64))
        for column in range(1, candidates.shape[1]):
            is_new = (candidates[:, :column] != candidates[:, column, None]).all(axis=1)
            todo = np.flatnonzero(is_new & (gap > _TOLERANCE_MM))
            if not len(todo):
                continue
            tried = candidates[todo, column]
            found = self._invert(points[todo], tried, starts[todo, column])
            distance = self._distance(points[todo], tried, found)
            better = distance < gap[todo]
            chosen = todo[better]
            best_element[chosen], best_local[chosen], gap[chosen] = tried[better], found[better], distance[better]
        return best_element, best_local

    def _distance(self, points: Floats, element: Integers, local: Floats) -> Floats:
        """Distance from the points to the element's own part of the extrapolated map."""
        position, _ = _evaluate(self._coefficients[element], np.clip(local, -1.0, 1.0))
        return np.asarray(np.linalg.norm(points - position, axis=1))

    def _invert(self, points: Floats, element: Integers, start: Floats) -> Floats:
        """Newton's method for local coordinates, kept within the cube of half width 3."""
        local = start.copy()
        active = np.arange(len(points))
        for _ in range(12):
            position, jacobian = _evaluate(self._coefficients[element[active]], local[active])
            step = _solve3(jacobian, points[active] - position)
            local[active] = np.clip(local[active] + np.clip(step, -1.0, 1.0), -3.0, 3.0)
            active = active[np.abs(step).max(axis=1) > 1e-9]
            if not len(active):
                break
        return local


def interpolate(hexes: Integers, element: Integers, local: Floats, nodal_values: Floats) -> Floats:
    """Values (N, ...) of a nodal field (M, ...) at the places that `Locator.locate` returned."""
    values = np.asarray(nodal_values, dtype=float)
    flat = values.reshape(len(values), -1)
    weights = shape_functions(local)
    nodes = hexes[element]
    result = np.zeros((len(element), flat.shape[1]))
    for corner in range(8):
        result += weights[:, corner, None] * flat[nodes[:, corner]]
    return result.reshape(len(element), *values.shape[1:])


def _monomial_coefficients(nodes: Floats) -> Floats:
    """Coefficients (E, 8, 3) of 1, x, y, z, xy, yz, zx, xyz in each element's map."""
    x, y, z = CORNERS.T
    basis = np.stack([np.ones(8), x, y, z, x * y, y * z, z * x, x * y * z], axis=1)
    return np.asarray(np.einsum("ba,eac->ebc", np.linalg.inv(basis), nodes, optimize=True))


def _evaluate(coefficients: Floats, local: Floats) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Positions (N, 3) and the three columns, each (N, 3), of the Jacobian matrices."""
    c = coefficients.transpose(1, 0, 2)
    x, y, z = local[:, 0, None], local[:, 1, None], local[:, 2, None]
    by_z = c[3] + x * c[6] + y * (c[5] + x * c[7])
    by_y = c[2] + x * c[4] + z * (c[5] + x * c[7])
    by_x = c[1] + y * c[4] + z * (c[6] + y * c[7])
    position = c[0] + x * c[1] + y * (c[2] + x * c[4]) + z * by_z
    return position, (by_x, by_y, by_z)


def _solve3(columns: tuple[Floats, Floats, Floats], right: Floats) -> Floats:
    """Solve 3 x 3 systems by Cramer's rule; singular ones get a step of zero."""
    a, b, c = columns
    across = np.cross(b, c)
    determinant = (a * across).sum(axis=1)
    safe = np.where(np.abs(determinant) > 1e-12, determinant, np.inf)
    steps = [(right * across), (right * np.cross(c, a)), (right * np.cross(a, b))]
    return np.stack([step.sum(axis=1) / safe for step in steps], axis=1)
