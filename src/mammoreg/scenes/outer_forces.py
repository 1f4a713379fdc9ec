"""Forces of the plates on the skin, from the plates' geometry and the pressures that the solver reports."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.scenes.gland import Floats

_SIMPSON = np.array([1.0, 4.0, 1.0]) / 3.0
_STEP_MM = 1e-4


@dataclass(frozen=True)
class PlateFace:
    """A plate that ends at `edge_p_mm` with a rounded lip; the lower one faces up (+1), the upper one down (-1)."""

    height_mm: float
    facing: int
    edge_p_mm: float
    lip_radius_mm: float

    def distance(self, points: Floats) -> Floats:
        """Signed distance (...) of points (..., 3), mm, positive outside."""
        beyond = points[..., 1] - (self.edge_p_mm - self.lip_radius_mm)
        above = self.facing * (points[..., 2] - self.height_mm) + self.lip_radius_mm
        outside = np.hypot(np.maximum(beyond, 0.0), np.maximum(above, 0.0))
        return np.asarray(outside + np.minimum(np.maximum(beyond, above), 0.0) - self.lip_radius_mm)

    def normal(self, points: Floats) -> Floats:
        """Outward unit normals (..., 3) at points, by central differences of the distance."""
        steps = _STEP_MM * np.eye(3)
        slopes = [self.distance(points + step) - self.distance(points - step) for step in steps]
        normal = np.stack(slopes, axis=-1)
        return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


@dataclass(frozen=True)
class Pressed:
    """Contact as the solver reports it (first axis: lower, upper plate).

    Attributes:
        faces: the plates.
        quads: faces (F, 4) that may touch them.
        pressure: at 3 x 3 Simpson points (2, F, 9) per undeformed area, kPa.
        traction: friction there (2, F, 9, 3), kPa.
    """

    faces: tuple[PlateFace, PlateFace]
    quads: NDArray[np.int64]
    pressure: Floats
    traction: Floats

    def nodal(self, undeformed: Floats, positions: Floats) -> Floats:
        """Forces (2, N, 3) of the plates on the nodes, mN."""
        shape, area = simpson_points(undeformed[self.quads])
        at = np.einsum("qa,fac->fqc", shape, positions[self.quads])
        forces = np.zeros((2, *positions.shape))
        for plate, face in enumerate(self.faces):
            stress = self.pressure[plate][..., None] * face.normal(at) + self.traction[plate]
            corner = np.einsum("fqc,fq,qa->fac", stress, area, shape)
            np.add.at(forces[plate], self.quads.ravel(), corner.reshape(-1, 3))
        return forces

    def penetration_mm(self, positions: Floats) -> float:
        """How far the deepest contact point lies inside a plate."""
        shape, _ = simpson_points(positions[self.quads])
        at = np.einsum("qa,fac->fqc", shape, positions[self.quads])
        return max(0.0, *(-float(face.distance(at).min()) for face in self.faces))

    def detached_share(self, positions: Floats, reach_mm: float) -> float:
        """Share of the pressure that acts where the skin is further than `reach_mm` from the plate."""
        shape, area = simpson_points(positions[self.quads])
        at = np.einsum("qa,fac->fqc", shape, positions[self.quads])
        far = np.stack([face.distance(at) > reach_mm for face in self.faces])
        load = np.abs(self.pressure) * area
        return float(load[far].sum() / max(load.sum(), 1e-12))

    def excess_friction(self, undeformed: Floats, coefficient: float) -> float:
        """Friction above the coefficient times the pressure, as a share of the whole normal force."""
        _, area = simpson_points(undeformed[self.quads])
        allowed = coefficient * self.pressure if np.isfinite(coefficient) else np.inf
        beyond = np.maximum(np.linalg.norm(self.traction, axis=-1) - allowed, 0.0)
        return float((beyond * area).sum() / max((self.pressure * area).sum(), 1e-12))


def simpson_points(corners: Floats) -> tuple[Floats, Floats]:
    """Shape functions (9, 4) at the 3 x 3 Simpson points of bilinear faces (F, 4, 3), and their areas (F, 9), mm2."""
    place = np.array([-1.0, 0.0, 1.0])
    r, s = (grid.ravel()[:, None] for grid in np.meshgrid(place, place, indexing="ij"))
    u, v = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
    shape = 0.25 * (1.0 + u * r) * (1.0 + v * s)
    along = np.einsum("qa,fac->fqc", 0.25 * u * (1.0 + v * s), corners)
    across = np.einsum("qa,fac->fqc", 0.25 * v * (1.0 + u * r), corners)
    weight = np.outer(_SIMPSON, _SIMPSON).ravel()
    return shape, np.linalg.norm(np.cross(along, across), axis=-1) * weight
