"""Soft contact with rigid plates: a smooth barrier against penetration and Coulomb friction with a lagged pressure.

For patients, where convergence matters more than the last tenth of a millimetre at a plate's lip. The normal pressure
is zero beyond a band above the plate, quadratic within it and linear below, so its derivative is continuous. Friction
takes its limit from the pressure of the last converged step: then both have potentials, the tangent is symmetric and
Newton's method does not chatter between sticking and slipping. Terms are per face with the plates' common height as
13th degree of freedom.

What the barrier's finite stiffness lets through is taken back by augmentation: each point's distance is shifted so
that the plate presses as hard with the point on its face (a multiplier, written as a shift). Sticking is friction
without a limit: springs draw a point that presses back to where it first did. They are not augmented, for a face's
points have first pressed one after the other and its corners cannot bring all of them back at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.contact.plate import Gap, Plate
from mammoreg.contact.surface import ContactSurface

STICKING_PRESSURE_KPA = 0.1  # gives friction a little stiffness where there was no pressure yet


NONE: Floats = np.zeros(0)
"""State that a contact does not need."""


@dataclass(frozen=True)
class SoftMemory:
    """What contact points remember of each plate since the last converged step (first axis: plates).

    Attributes:
        anchor: places relative to the plates (plates, F, q, 3), mm; empty without friction.
        traction: friction (plates, F, q, 3), kPa, zero where it sticks without limit; empty without friction.
        pressure: normal pressure (plates, F, q), kPa; empty without friction.
        shift: added to the distances (plates, F, q), mm; empty without augmentation.
    """

    anchor: Floats
    traction: Floats
    pressure: Floats
    shift: Floats = field(default_factory=NONE.copy)

    def part(self, faces: NDArray[np.bool_]) -> "SoftMemory":
        """What the contact points of the faces that a mask (F,) selects remember."""
        kept = (
            data[:, faces] if data.size else data for data in (self.anchor, self.traction, self.pressure, self.shift)
        )
        return SoftMemory(*kept)


@dataclass(frozen=True)
class SoftTerms:
    """Contribution of contact to the equilibrium.

    Attributes:
        force: residual (F, 13), mN.
        stiffness: its derivative (F, 13, 13), mN/mm, symmetric.
        pressure: (plates, F, q), kPa.
        traction: friction (plates, F, q, 3), kPa; empty without friction.
        plate_force: of each plate on the body (plates, 3), mN.
        penetration_mm: deepest point inside a plate.
    """

    force: Floats
    stiffness: Floats
    pressure: Floats
    traction: Floats
    plate_force: Floats
    penetration_mm: float


@dataclass(frozen=True)
class SoftContact:
    """Faces that touch plates.

    Attributes:
        surface: contact points of the faces.
        stiffness: of the barrier, kPa/mm.
        band_mm: the pressure sets in this far above the plate.
        friction: Coulomb coefficient; infinite: sticking.
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

    def part(self, faces: NDArray[np.bool_]) -> "SoftContact":
        """The contact of the faces that a mask (F,) selects."""
        return replace(self, surface=self.surface.part(faces))

    @property
    def sticks(self) -> bool:
        """Whether friction has no limit."""
        return bool(np.isinf(self.friction))

    def start(self, nodes: Floats, plates: Sequence[Plate], height: float) -> SoftMemory:
        """Memory of a body that has not pressed yet, at nodes (N, 3); where it touches already, sticking begins."""
        if self.friction == 0.0:
            return SoftMemory(NONE, NONE, NONE)
        anchor = self._relative(nodes, plates, height)
        pressure = np.zeros(anchor.shape[:-1])
        if self.sticks:
            points = self.points(nodes, height)
            pressure = np.stack([self._barrier(plate.gap(points).distance)[0] for plate in plates])
        return SoftMemory(anchor, np.zeros_like(anchor), pressure)

    def remember(
        self, nodes: Floats, plates: Sequence[Plate], height: float, terms: SoftTerms, before: SoftMemory
    ) -> SoftMemory:
        """Memory after a converged step that began with the memory `before`."""
        if self.friction == 0.0:
            return replace(before)
        anchor, traction = self._relative(nodes, plates, height), terms.traction
        if self.sticks:
            pressing = terms.pressure > 0.0
            anchor = np.where((pressing & (before.pressure > 0.0))[..., None], before.anchor, anchor)
            traction = np.zeros_like(anchor)
        return SoftMemory(anchor, traction, terms.pressure, before.shift)

    def augmented(self, nodes: Floats, plates: Sequence[Plate], height: float, memory: SoftMemory) -> SoftMemory:
        """Memory whose shifts let each plate press as now with the points on its face, and no others."""
        points = self.points(nodes, height)
        distance = np.stack([self._distance(plate.gap(points), memory, k) for k, plate in enumerate(plates)])
        return replace(memory, shift=np.minimum(distance, self.band_mm))

    def terms(self, nodes: Floats, height: float, plates: Sequence[Plate], memory: SoftMemory) -> SoftTerms:
        """Forces and tangent at nodes (N, 3) with the plates raised by `height` mm."""
        points = self.points(nodes, height)
        relative = self._relative(nodes, plates, height) if self.friction > 0.0 else None
        total, tangent = np.zeros(points.shape), np.zeros((*points.shape, 3))
        pressures, tractions, forces, deepest = [], [], [], 0.0
        for k, plate in enumerate(plates):
            gap = plate.gap(points)
            pressure, slope = self._barrier(self._distance(gap, memory, k))
            dyad = gap.normal[..., :, None] * gap.normal[..., None, :]
            tangent += slope[..., None, None] * dyad - pressure[..., None, None] * gap.hessian()
            force = pressure[..., None] * gap.normal
            if relative is not None:
                traction, stick = self._friction(plate, memory, k, relative[k] - memory.anchor[k])
                tangent += stick
                force = force + traction
                tractions.append(traction)
            force = force * self.surface.area[..., None]
            total -= force
            pressures.append(pressure)
            forces.append(force.sum(axis=(0, 1)))
            deepest = max(deepest, -float(gap.distance.min()))
        force, stiffness = self._to_corners(total, tangent)
        traction = np.stack(tractions) if tractions else NONE
        return SoftTerms(force, stiffness, np.stack(pressures), traction, np.stack(forces), deepest)

    def energy_mj(self, nodes: Floats, height: float, plates: Sequence[Plate], memory: SoftMemory) -> float:
        """Potential of the pressure and of friction with its lagged limit."""
        points = self.points(nodes, height)
        relative = self._relative(nodes, plates, height) if self.friction > 0.0 else None
        density = np.zeros(points.shape[:-1])
        for k, plate in enumerate(plates):
            gap = plate.gap(points)
            density += self._barrier_energy(self._distance(gap, memory, k))
            if relative is not None:
                density += self._friction_energy(plate, memory, k, relative[k] - memory.anchor[k])
        return 1e-3 * float((density * self.surface.area).sum())

    def points(self, nodes: Floats, height: float) -> Floats:
        """Contact points (F, q, 3) as the plates see them that are raised by `height` mm."""
        return np.asarray(self.surface.positions(nodes) - np.array([0.0, 0.0, height]))

    @staticmethod
    def _distance(gap: Gap, memory: SoftMemory, k: int) -> Floats:
        """Distance (F, q) that the barrier of plate k takes."""
        return np.asarray(gap.distance + memory.shift[k]) if memory.shift.size else gap.distance

    def _relative(self, nodes: Floats, plates: Sequence[Plate], height: float) -> Floats:
        points = self.surface.positions(nodes)
        return np.stack([points - np.array([0.0, 0.0, plate.height_mm + height]) for plate in plates])

    def _barrier(self, distance: Floats) -> tuple[Floats, Floats]:
        """Pressure, kPa, and minus its derivative by the distance, kPa/mm."""
        depth = np.clip(self.band_mm - distance, 0.0, 2.0 * self.band_mm)
        slope = self.stiffness * depth / (2.0 * self.band_mm)
        pressure = 0.5 * slope * depth + self.stiffness * np.maximum(-distance - self.band_mm, 0.0)
        return pressure, slope

    def _barrier_energy(self, distance: Floats) -> Floats:
        """Energy per area, mN/mm, whose derivative by the distance is minus the pressure."""
        depth = np.clip(self.band_mm - distance, 0.0, 2.0 * self.band_mm)
        beyond = np.maximum(-distance - self.band_mm, 0.0)
        early = depth**3 / (12.0 * self.band_mm)
        return np.asarray(self.stiffness * (early + beyond * (self.band_mm + 0.5 * beyond)))

    def _limit(self, pressure: Floats) -> tuple[Floats, Floats]:
        """Limit of friction (F, q), kPa, under a lagged pressure, and its stiffness while it sticks, kPa/mm."""
        if self.sticks:
            pressing = pressure > 0.0
            return np.where(pressing, np.inf, 0.0), np.where(pressing, self.stiffness, 0.0)
        limit = self.friction * pressure
        return limit, np.maximum(limit, self.friction * STICKING_PRESSURE_KPA) / self.slip_mm

    def _friction(self, plate: Plate, memory: SoftMemory, k: int, slip: Floats) -> tuple[Floats, Floats]:
        """Radial return within a disc of lagged radius: traction (F, q, 3) and its stiffness (F, q, 3, 3)."""
        limit, stick = self._limit(memory.pressure[k])
        plane = _tangential(plate, memory.anchor[k])
        trial = np.einsum("fqij,fqj->fqi", plane, memory.traction[k] - stick[..., None] * slip)
        size = np.linalg.norm(trial, axis=-1)
        safe = np.where(size > 0.0, size, 1.0)
        slides = size > limit
        fraction = np.where(slides, np.where(slides, limit, 0.0) / safe, 1.0)
        direction = trial / safe[..., None]
        along = np.where(slides[..., None, None], direction[..., :, None] * direction[..., None, :], 0.0)
        return trial * fraction[..., None], (fraction * stick)[..., None, None] * (plane - along)

    def _friction_energy(self, plate: Plate, memory: SoftMemory, k: int, slip: Floats) -> Floats:
        """Potential per area, mN/mm, of `_friction`."""
        limit, stick = self._limit(memory.pressure[k])
        plane = _tangential(plate, memory.anchor[k])
        trial = np.einsum("fqij,fqj->fqi", plane, memory.traction[k] - stick[..., None] * slip)
        size = np.linalg.norm(trial, axis=-1)
        within = np.minimum(size, limit)
        return np.asarray(within * (size - 0.5 * within) / np.where(stick > 0.0, stick, np.inf))

    def _to_corners(self, force: Floats, stiffness: Floats) -> tuple[Floats, Floats]:
        faces, shape = len(self.surface.quads), self.surface.shape
        interpolation = np.zeros((len(shape), 3, 13))
        for axis in range(3):
            interpolation[:, axis, axis:12:3] = shape
        interpolation[:, 2, 12] = -1.0
        flat = interpolation.reshape(-1, 13)
        product = (stiffness * self.surface.area[..., None, None]) @ interpolation
        return force.reshape(faces, -1) @ flat, flat.T @ product.reshape(faces, -1, 13)


def _tangential(plate: Plate, anchor: Floats) -> Floats:
    """Projections (F, q, 3, 3) onto the plate's face at the anchors, where friction acts: fixed within a step."""
    normal = plate.gap(anchor + np.array([0.0, 0.0, plate.height_mm])).normal
    return np.asarray(np.eye(3) - normal[..., :, None] * normal[..., None, :])


def plate_pair(gap_mm: float, middle_mm: float, edge_p_mm: float | None, lip_radius_mm: float) -> tuple[Plate, Plate]:
    """Lower and upper plate with a gap around a middle height."""
    low, high = middle_mm - 0.5 * gap_mm, middle_mm + 0.5 * gap_mm
    return Plate(low, 1, edge_p_mm, lip_radius_mm), Plate(high, -1, edge_p_mm, lip_radius_mm)


def touching(points: NDArray[np.float64], edge_p_mm: float | None, lip_radius_mm: float) -> tuple[float, float]:
    """Heights at which the lower and the upper plate first touch points (N, 3)."""
    low, high = (Plate(0.0, facing, edge_p_mm, lip_radius_mm).first_touch(points) for facing in (1, -1))
    return low, high
