"""Interface between a body and a skin that encloses it: presses, and slides without friction or sticks without slip.

Node to surface: each free node of the skin has a foot on the body's surface. Foot and normal are taken from the last
converged step and renewed after each, so within a step the interface has a potential, its tangent is symmetric, and
Newton's method does not chatter from face to face:

    g = n . (x_skin - x_foot)                          gap, mm
    psi = area (integral of the barrier's pressure)    barrier as in `mammoreg.contact.soft`, its onset at g = 0
        + area cling/2 g^2
        + area kappa/2 |tangential part of x_skin - x_foot|^2

Where skin sticks, its foot stays and kappa is as stiff as the barrier. Where it slides, the foot follows it at each
renewal and a soft kappa only keeps it from leaping back and forth between one foot and the next: at rest it bears
nothing. The weak cling gives slack skin that has lifted off a place.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.linear.system import node_dofs
from mammoreg.fem.skin.surface import QuadSurface

ONSET_MM = 0.05
"""Half the depth over which the barrier's stiffness grows to its whole value."""
CLING_PER_MM, DRAG_PER_MM = 0.1, 0.002
"""Stiffness against lifting off, and against sliding within a step, in units of the skin's shear modulus, 1/mm."""
TOUCH_MM = 0.5
"""Skin nearer than this to the tissue touches it, and sticks where it adheres."""


@dataclass(frozen=True)
class SkinInterface:
    """Skin nodes and their feet on the body, a part of an equilibrium.

    Attributes:
        surface: the body's.
        nodes: of the skin (M,).
        area: undeformed area (M,) of skin around each, mm2.
        stiffness: of the barrier, and of the springs where skin sticks, kPa/mm.
        cling: stiffness of the gap beside the barrier, kPa/mm.
        drag: of the springs where skin slides, kPa/mm.
        adherent: whether skin sticks where it touches.
        face: faces (M,) of the feet.
        shape: weights (M, 4) of their corners.
        normal: unit normals (M, 3) there, outward.
        stuck: where skin sticks (M,); its foot stays.
    """

    surface: QuadSurface
    nodes: Integers
    area: Floats
    stiffness: float
    cling: float
    drag: float
    adherent: bool
    face: Integers
    shape: Floats
    normal: Floats
    stuck: NDArray[np.bool_]

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (M, 15): the node's and the four corners' of its foot's face."""
        return node_dofs(np.column_stack([self.nodes, self.surface.quads[self.face]]))

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (M, 15), mN, and stiffness (M, 15, 15), mN/mm, at nodes (N, 3)."""
        apart = self._apart(positions)
        gap = self._along(apart)
        pressure, slope = self._barrier(gap)
        dyad = self.normal[:, :, None] * self.normal[:, None, :]
        hold = np.where(self.stuck, self.stiffness, self.drag)
        pull = -pressure[:, None] * self.normal + hold[:, None] * (apart - gap[:, None] * self.normal)
        stiff = slope[:, None, None] * dyad + hold[:, None, None] * (np.eye(3) - dyad)
        signed = np.column_stack([np.ones(len(self.nodes)), -self.shape])
        force = signed[:, :, None] * (self.area[:, None] * pull)[:, None, :]
        weights = self.area[:, None, None] * signed[:, :, None] * signed[:, None, :]
        blocks = weights[:, :, None, :, None] * stiff[:, None, :, None, :]
        return force.reshape(-1, 15), blocks.reshape(-1, 15, 15)

    def energy_mj(self, positions: Floats) -> float:
        """Energy of the barrier and of the springs that hold stuck skin, mJ."""
        apart = self._apart(positions)
        gap = self._along(apart)
        depth = np.maximum(-gap, 0.0)
        early, late = np.minimum(depth, 2.0 * ONSET_MM), np.maximum(depth - 2.0 * ONSET_MM, 0.0)
        density = self.stiffness * (early**3 / (12.0 * ONSET_MM) + late * (ONSET_MM + 0.5 * late))
        density += 0.5 * self.cling * gap**2
        slip = apart - gap[:, None] * self.normal
        density += 0.5 * np.where(self.stuck, self.stiffness, self.drag) * (slip**2).sum(axis=1)
        return 1e-3 * float((self.area * density).sum())

    def renewed(self, positions: Floats) -> "SkinInterface":
        """With feet, normals and sticking places as at converged nodes (N, 3)."""
        foot = self.surface.project(positions[self.nodes], positions, self.face)
        fresh = replace(self, face=foot.face, shape=foot.shape, normal=foot.normal)
        if not self.adherent:
            return fresh
        # Skin that has stuck keeps its place on the tissue for as long as it touches.
        turned = replace(self, normal=self.surface.normal_at(positions, self.face, self.shape))
        kept = self.stuck & (turned.gap_mm(positions) < TOUCH_MM)
        face = np.where(kept, self.face, fresh.face)
        shape = np.where(kept[:, None], self.shape, fresh.shape)
        normal = np.where(kept[:, None], turned.normal, fresh.normal)
        return replace(fresh, face=face, shape=shape, normal=normal, stuck=fresh.gap_mm(positions) < TOUCH_MM)

    def gap_mm(self, positions: Floats) -> Floats:
        """Distance (M,) of the nodes from their feet, negative where skin and body overlap."""
        return self._along(self._apart(positions))

    def _apart(self, positions: Floats) -> Floats:
        corners = positions[self.surface.quads[self.face]]
        return np.asarray(positions[self.nodes] - np.einsum("ma,mai->mi", self.shape, corners))

    def _along(self, apart: Floats) -> Floats:
        return np.asarray(np.einsum("mi,mi->m", apart, self.normal))

    def _barrier(self, gap: Floats) -> tuple[Floats, Floats]:
        """Pressure (M,), kPa, and minus its derivative by the gap, kPa/mm."""
        depth = np.clip(-gap, 0.0, 2.0 * ONSET_MM)
        slope = self.stiffness * depth / (2.0 * ONSET_MM)
        pressure = 0.5 * slope * depth + self.stiffness * np.maximum(-gap - 2.0 * ONSET_MM, 0.0)
        return pressure - self.cling * gap, slope + self.cling


def skin_interface(
    points: Floats,
    body_quads: NDArray[np.integer],
    skin_quads: NDArray[np.integer],
    stiffness: float,
    skin_mu_kpa: float,
    *,
    adherent: bool,
) -> SkinInterface:
    """Interface of a skin that lies node on node on a body.

    Args:
        points: undeformed nodes (N, 3) of body and skin, mm.
        body_quads: faces (F, 4) of the body's surface, outward.
        skin_quads: the faces (F, 4) of the skin over them; nodes that both name are tied and have no interface.
        stiffness: of the barrier, kPa/mm.
        skin_mu_kpa: initial shear modulus of the skin.
        adherent: whether skin sticks where it touches.
    """
    surface = QuadSurface(body_quads)
    over, first = np.unique(np.asarray(skin_quads, dtype=np.int64), return_index=True)
    under = surface.quads.ravel()[first]
    own = over != under
    nodes = over[own]
    face, shape = surface.faces_of(under[own])
    area = np.linalg.norm(QuadSurface(skin_quads).areas(points), axis=1)[nodes]
    return SkinInterface(
        surface=surface,
        nodes=nodes,
        area=area,
        stiffness=stiffness,
        cling=CLING_PER_MM * skin_mu_kpa,
        drag=DRAG_PER_MM * skin_mu_kpa,
        adherent=adherent,
        face=face,
        shape=shape,
        normal=surface.normal_at(points, face, shape),
        stuck=np.full(len(nodes), adherent),
    )
