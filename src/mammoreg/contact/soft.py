"""Soft contact with rigid plates: a smooth barrier against penetration and Coulomb friction with a lagged pressure.

For patients, where convergence matters more than the last tenth of a millimetre at a plate's lip. The normal pressure
is zero beyond a band above the plate, quadratic within it and linear below, so its derivative is continuous. Friction
takes its limit from the pressure of the last converged step: then both have potentials, the tangent is symmetric and
Newton's method does not chatter between sticking and slipping. Terms are per face with the plates' common height as
13th degree of freedom.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.plate import Array, Plate
from mammoreg.contact.surface import ContactSurface

STICKING_PRESSURE_KPA = 0.1  # gives friction a little stiffness where there was no pressure yet


@dataclass(frozen=True)
class SoftMemory:
    """What contact points remember of each plate since the last converged step (first axis: plates).

    Attributes:
        anchor: places relative to the plates (plates, F, q, 3), mm.
        traction: friction (plates, F, q, 3), kPa.
        pressure: normal pressure (plates, F, q), kPa.
    """

    anchor: Array
    traction: Array
    pressure: Array


@dataclass(frozen=True)
class SoftTerms:
    """Contribution of contact to the equilibrium.

    Attributes:
        force: residual (F, 13), mN.
        stiffness: its derivative (F, 13, 13), mN/mm, symmetric.
        pressure: (plates, F, q), kPa.
        traction: friction (plates, F, q, 3), kPa.
        plate_force: of each plate on the body (plates, 3), mN.
        penetration_mm: deepest point inside a plate.
    """

    force: Array
    stiffness: Array
    pressure: Array
    traction: Array
    plate_force: Array
    penetration_mm: float


@dataclass(frozen=True)
class SoftContact:
    """Faces that touch plates.

    Attributes:
        surface: contact points of the faces.
        stiffness: of the barrier, kPa/mm.
        band_mm: the pressure sets in this far above the plate.
        friction: Coulomb coefficient.
        slip_mm: displacement at which friction reaches its limit.
    """

    surface: ContactSurface
    stiffness: float
    band_mm: float = 1.0
    friction: float = 0.0
    slip_mm: float = 1.0

    def stiffened(self, factor: float) -> "SoftContact":
        """The same contact, stiffer by a factor; its onset shrinks alike, which keeps the pressure at the plate."""
        return replace(self, stiffness=factor * self.stiffness, band_mm=self.band_mm / factor)

    def start(self, nodes: Array, plates: Sequence[Plate], height: float) -> SoftMemory:
        """Memory of a body that has not touched yet, at nodes (N, 3)."""
        anchor = self._relative(nodes, plates, height)
        return SoftMemory(anchor, np.zeros_like(anchor), np.zeros(anchor.shape[:-1]))

    def remember(self, nodes: Array, plates: Sequence[Plate], height: float, terms: SoftTerms) -> SoftMemory:
        """Memory after a converged step."""
        return SoftMemory(self._relative(nodes, plates, height), terms.traction, terms.pressure)

    def terms(self, nodes: Array, height: float, plates: Sequence[Plate], memory: SoftMemory) -> SoftTerms:
        """Forces and tangent at nodes (N, 3) with the plates raised by `height` mm."""
        points = self.surface.positions(nodes) - np.array([0.0, 0.0, height])
        relative = self._relative(nodes, plates, height) if self.friction > 0.0 else None
        total, tangent = np.zeros(points.shape), np.zeros((*points.shape, 3))
        pressures, tractions, forces, deepest = [], [], [], 0.0
        for k, plate in enumerate(plates):
            gap = plate.gap(points)
            pressure, slope = self._barrier(gap.distance)
            dyad = gap.normal[..., :, None] * gap.normal[..., None, :]
            tangent += slope[..., None, None] * dyad - pressure[..., None, None] * gap.hessian()
            traction = np.zeros(points.shape)
            if relative is not None:
                slip = relative[k] - memory.anchor[k]
                traction, stick = self._friction(dyad, memory.traction[k], memory.pressure[k], slip)
                tangent += stick
            force = (pressure[..., None] * gap.normal + traction) * self.surface.area[..., None]
            total -= force
            pressures.append(pressure)
            tractions.append(traction)
            forces.append(force.sum(axis=(0, 1)))
            deepest = max(deepest, -float(gap.distance.min()))
        force, stiffness = self._to_corners(total, tangent)
        return SoftTerms(force, stiffness, np.stack(pressures), np.stack(tractions), np.stack(forces), deepest)

    def _relative(self, nodes: Array, plates: Sequence[Plate], height: float) -> Array:
        points = self.surface.positions(nodes)
        return np.stack([points - np.array([0.0, 0.0, plate.height_mm + height]) for plate in plates])

    def _barrier(self, distance: Array) -> tuple[Array, Array]:
        """Pressure, kPa, and minus its derivative by the distance, kPa/mm."""
        depth = np.clip(self.band_mm - distance, 0.0, 2.0 * self.band_mm)
        slope = self.stiffness * depth / (2.0 * self.band_mm)
        pressure = 0.5 * slope * depth + self.stiffness * np.maximum(-distance - self.band_mm, 0.0)
        return pressure, slope

    def _friction(self, dyad: Array, old: Array, pressure: Array, slip: Array) -> tuple[Array, Array]:
        """Radial return within a disc of lagged radius: traction (F, q, 3) and its stiffness (F, q, 3, 3)."""
        limit = self.friction * pressure
        stick = np.maximum(limit, self.friction * STICKING_PRESSURE_KPA) / self.slip_mm
        plane = np.eye(3) - dyad
        trial = np.einsum("fqij,fqj->fqi", plane, old - stick[..., None] * slip)
        size = np.linalg.norm(trial, axis=-1)
        safe = np.where(size > 0.0, size, 1.0)
        share = np.where(size > limit, limit / safe, 1.0)
        direction = trial / safe[..., None]
        along = np.where((size > limit)[..., None, None], direction[..., :, None] * direction[..., None, :], 0.0)
        return trial * share[..., None], (share * stick)[..., None, None] * (plane - along)

    def _to_corners(self, force: Array, stiffness: Array) -> tuple[Array, Array]:
        faces, shape = len(self.surface.quads), self.surface.shape
        interpolation = np.zeros((len(shape), 3, 13))
        for axis in range(3):
            interpolation[:, axis, axis:12:3] = shape
        interpolation[:, 2, 12] = -1.0
        flat = interpolation.reshape(-1, 13)
        product = (stiffness * self.surface.area[..., None, None]) @ interpolation
        return force.reshape(faces, -1) @ flat, flat.T @ product.reshape(faces, -1, 13)


def plate_pair(gap_mm: float, middle_mm: float, edge_p_mm: float | None, lip_radius_mm: float) -> tuple[Plate, Plate]:
    """Lower and upper plate with a gap around a middle height."""
    low, high = middle_mm - 0.5 * gap_mm, middle_mm + 0.5 * gap_mm
    return Plate(low, 1, edge_p_mm, lip_radius_mm), Plate(high, -1, edge_p_mm, lip_radius_mm)


def touching(points: NDArray[np.float64], edge_p_mm: float | None, lip_radius_mm: float) -> tuple[float, float]:
    """Heights at which the lower and the upper plate first touch points (N, 3)."""
    low, high = (Plate(0.0, facing, edge_p_mm, lip_radius_mm).first_touch(points) for facing in (1, -1))
    return low, high
