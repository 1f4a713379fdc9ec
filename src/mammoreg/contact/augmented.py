"""Augmented-Lagrangian contact of a body with rigid plates: forces and tangent of the skin's faces.

The potential of a contact point of area w is w / (2 eps) (max(0, lambda - eps g)^2 - lambda^2) with the distance g, the
penalty eps (kPa/mm) and the multiplier lambda (kPa). Coulomb friction is regularised: the traction grows with the slip
since the last converged load step until it reaches the friction coefficient times the pressure. Both plates share one
height unknown (degree of freedom 12 of each face); points are measured relative to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.plate import Array, Gap, Plate
from mammoreg.contact.surface import ContactSurface


@dataclass(frozen=True)
class ContactState:
    """What the contact points remember of each plate (first axis: plates).

    Attributes:
        multiplier: lambda (plates, F, q), kPa.
        traction: friction traction at the last converged step (plates, F, q, 3), kPa.
        anchor: contact points relative to the plates at that step (plates, F, q, 3), mm.
        penalty: kPa/mm, grows within a load step from soft to stiff.
    """

    multiplier: Array
    traction: Array
    anchor: Array
    penalty: float


@dataclass(frozen=True)
class ContactTerms:
    """Contribution of contact to the equilibrium.

    Attributes:
        force: residual (F, 13), mN: corners' components, then the height.
        stiffness: its derivative (F, 13, 13), mN/mm.
        pressure: contact pressure (plates, F, q), kPa, not negative.
        traction: friction traction (plates, F, q, 3), kPa.
        distance: to the plates (plates, F, q), mm.
        plate_force: force of each plate on the body (plates, 3), mN.
    """

    force: Array
    stiffness: Array
    pressure: Array
    traction: Array
    distance: Array
    plate_force: Array
    flat: NDArray[np.bool_]


@dataclass(frozen=True)
class PlateContact:
    """A surface, penalties (kPa/mm) and friction coefficient."""

    surface: ContactSurface
    penalty: float
    stiffest: float
    friction: float = 0.0
    tangential_penalty: float = 20.0
    growth: float = 4.0
    smoothing_mm: float = 0.05
    lip: float = 50.0

    def start(self, nodes: Array, plates: Sequence[Plate], height: float = 0.0) -> ContactState:
        """State without any contact yet at nodes (N, 3)."""
        points = self._relative(nodes, plates, height)
        return ContactState(np.zeros(points.shape[:-1]), np.zeros(points.shape), points, self.penalty)

    def _relative(self, nodes: Array, plates: Sequence[Plate], height: float) -> Array:
        """Contact points relative to each plate's face (plates, F, q, 3)."""
        points = self.surface.positions(nodes)
        return np.stack([points - np.array([0.0, 0.0, plate.height_mm + height]) for plate in plates])

    def terms(self, nodes: Array, height: float, plates: Sequence[Plate], state: ContactState) -> ContactTerms:
        """Forces and tangent with the plates' common extra `height` in mm."""
        points = self.surface.positions(nodes) - np.array([0.0, 0.0, height])
        relative = self._relative(nodes, plates, height)
        pressures, tractions, distances, forces, flats = [], [], [], [], []
        point_force, point_stiffness = np.zeros(points.shape), np.zeros((*points.shape, 3))
        for k, plate in enumerate(plates):
            gap = plate.gap(points)
            penalty = np.where(gap.flat, state.penalty, np.minimum(self.lip, state.penalty))
            pressure, slope = smooth_ramp(state.multiplier[k] - penalty * gap.distance, penalty * self.smoothing_mm)
            point_stiffness += _normal_stiffness(gap, pressure, slope * penalty)
            traction = np.zeros(points.shape)
            if self.friction > 0.0:
                slip = relative[k] - state.anchor[k]
                traction, stiffness = self._friction(gap.normal, pressure, state.traction[k], slip, slope * penalty)
                point_stiffness += stiffness
            force = (pressure[..., None] * gap.normal + traction) * self.surface.area[..., None]
            point_force -= force
            pressures.append(pressure)
            tractions.append(traction)
            distances.append(gap.distance)
            flats.append(gap.flat)
            forces.append(force.sum(axis=(0, 1)))
        face_force, face_stiffness = self._to_corners(point_force, point_stiffness)
        return ContactTerms(
            face_force,
            face_stiffness,
            np.stack(pressures),
            np.stack(tractions),
            np.stack(distances),
            np.stack(forces),
            np.stack(flats),
        )

    def _friction(self, normal: Array, pressure: Array, old: Array, slip: Array, penalty: Array) -> tuple[Array, Array]:
        """Return mapping: friction traction (F, q, 3) and minus its derivative by the position (F, q, 3, 3)."""
        tangent = np.eye(3) - normal[..., :, None] * normal[..., None, :]
        trial = np.einsum("fqij,fqj->fqi", tangent, old - self.tangential_penalty * slip)
        size = np.linalg.norm(trial, axis=-1)
        limit = self.friction * pressure
        slipping = size > limit
        direction = trial / np.where(size > 0.0, size, 1.0)[..., None]
        share = np.where(slipping, limit / np.where(size > 0.0, size, 1.0), 1.0)
        along = direction[..., :, None] * direction[..., None, :]
        stick = self.tangential_penalty * tangent
        turn = share[..., None, None] * self.tangential_penalty * (tangent - along)
        press = self.friction * penalty[..., None, None] * direction[..., :, None] * normal[..., None, :]
        stiffness = np.where(slipping[..., None, None], turn + press, stick)
        stiffness = np.where((pressure > 0.0)[..., None, None], stiffness, 0.0)
        return trial * share[..., None], stiffness

    def _to_corners(self, force: Array, stiffness: Array) -> tuple[Array, Array]:
        """Gather tractions (F, q, 3) and their stiffness (F, q, 3, 3) to corners and height (F, 13), (F, 13, 13)."""
        faces, shape = len(self.surface.quads), self.surface.shape
        weighted = stiffness * self.surface.area[..., None, None]
        interpolation = np.zeros((len(shape), 3, 13))
        for axis in range(3):
            interpolation[:, axis, axis:12:3] = shape
        interpolation[:, 2, 12] = -1.0
        flat = interpolation.reshape(-1, 13)
        product = weighted @ interpolation
        return force.reshape(faces, -1) @ flat, flat.T @ product.reshape(faces, -1, 13)


def smooth_ramp(value: Array, width: Array) -> tuple[Array, Array]:
    """max(value, 0) rounded by a parabola within +-width, and its slope; a kink makes Newton's method cycle."""
    inside = np.clip(value / width + 1.0, 0.0, 2.0)
    return np.where(inside < 2.0, 0.25 * width * inside**2, value), 0.5 * inside


def _normal_stiffness(gap: Gap, pressure: Array, stiffness: Array) -> Array:
    """Derivative of minus the normal traction by the position (F, q, 3, 3), kPa/mm."""
    dyad = gap.normal[..., :, None] * gap.normal[..., None, :]
    return np.asarray(stiffness[..., None, None] * dyad - pressure[..., None, None] * gap.hessian())
