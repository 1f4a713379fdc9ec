"""Contact of a digital patient's skin with the plates, made smooth: a soft layer and regularised friction.

Unlike the registration's contact (augmented Lagrangian, return mapping) each node carries a pressure that grows
smoothly with depth, k w log(1 + exp(-gap / w)), and a friction along its distance from an anchor that it drags behind
it; its size is bounded by the coefficient times the last step's pressure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.plate import Plate
from mammoreg.phantom.shape import Array

SMOOTHING_MM = 0.25
SLIP_MM = 0.1
ROPE_MM = 0.4
"""A node farther than this from its anchor drags it along; there friction has 97 % of its limit."""
TOUCHING_KPA = 0.05


@dataclass(frozen=True)
class Grip:
    """Friction's memory: its limit (plates, C) in kPa and anchors (plates, C, 3) in mm."""

    limit: Array
    anchor: Array

    @classmethod
    def none(cls, places: Array) -> "Grip":
        """No friction yet, nodes at places (C, 3)."""
        return cls(np.zeros((2, len(places))), np.stack([places, places]))

    def renewed(self, pressure: Array, places: Array, friction: float) -> "Grip":
        """After a load step that ended with pressures (plates, C) at places (C, 3)."""
        rope = places - self.anchor
        length = np.linalg.norm(rope, axis=-1, keepdims=True)
        held = np.minimum(1.0, ROPE_MM / np.maximum(length, 1e-9)) * (pressure > TOUCHING_KPA)[..., None]
        return Grip(friction * pressure, places - held * rope)


@dataclass(frozen=True)
class Touch:
    """Contact of some nodes.

    Attributes:
        force: on the body (C, 3), mN.
        stiffness: minus its derivative by the nodes' places (C, 3, 3), mN/mm.
        pressure: (plates, C), kPa.
        plate_force: of each plate on the body (plates, 3), mN.
    """

    force: Array
    stiffness: Array
    pressure: Array
    plate_force: Array


@dataclass(frozen=True)
class SkinNodes:
    """Nodes of the skin with the area (C,) in mm2 that each stands for."""

    nodes: NDArray[np.int64]
    area: Array

    @classmethod
    def of(cls, points: Array, quads: NDArray[np.int64]) -> "SkinNodes":
        """A quarter of each face (F, 4) for each of its corners."""
        corners = points[quads]
        face = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)
        area = np.bincount(quads.ravel(), weights=np.repeat(0.25 * face, 4), minlength=len(points))
        nodes = np.flatnonzero(area > 0.0)
        return cls(nodes, np.asarray(area[nodes], dtype=float))

    def touch(self, places: Array, grip: Grip, plates: tuple[Plate, ...], layer: float) -> Touch:
        """Contact at nodes' places (C, 3) in mm; `layer` is the stiffness of the plates' surface, kPa/mm."""
        count = len(places)
        total = Touch(np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros(grip.limit.shape), np.zeros((2, 3)))
        for k, plate in enumerate(plates):
            gap = plate.gap(places)
            depth = -gap.distance / SMOOTHING_MM
            pressure = layer * SMOOTHING_MM * np.logaddexp(0.0, depth)
            rate = layer / (1.0 + np.exp(-np.clip(depth, -50.0, 50.0)))
            normal = gap.normal[:, :, None] * gap.normal[:, None, :]
            rubbing, resistance = _friction(np.eye(3) - normal, places - grip.anchor[k], grip.limit[k])
            force = (pressure[:, None] * gap.normal + rubbing) * self.area[:, None]
            stiffness = rate[:, None, None] * normal - pressure[:, None, None] * gap.hessian() + resistance
            total.force[:] += force
            total.stiffness[:] += stiffness * self.area[:, None, None]
            total.pressure[k] = pressure
            total.plate_force[k] = force.sum(axis=0)
        return total


def _friction(tangent: Array, moved: Array, limit: Array) -> tuple[Array, Array]:
    """Friction (C, 3), kPa, against the tangential part of a motion (C, 3), mm, and minus its derivative."""
    slip = np.einsum("cij,cj->ci", tangent, moved)
    size = np.sqrt((slip**2).sum(axis=1) + SLIP_MM**2)
    along = slip / size[:, None]
    share = (limit / size)[:, None, None]
    return -limit[:, None] * along, share * (tangent - along[:, :, None] * along[:, None, :])
