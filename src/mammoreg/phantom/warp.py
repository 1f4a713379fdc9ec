"""The deformed patient: where tissue at a place between the plates came from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.meshing.locate import Locator, interpolate
from mammoreg.meshing.trilinear import shape_gradients
from mammoreg.phantom.anatomy import AIR, Anatomy, Tissue
from mammoreg.phantom.mesh import PhantomMesh
from mammoreg.phantom.shape import Array

MAP_SPACING_MM = 1.8
NEAR_MM = 3.0 * MAP_SPACING_MM
FADE_MM = 20.0
PIECE = 60000
"""Places located at once, which bounds the memory."""


@dataclass(frozen=True)
class Motion:
    """A rigid motion: places between the plates = foot + turn (undeformed place - start)."""

    turn: Array
    start: Array
    foot: Array


class Deformed:
    """A patient whose meshed breast has been deformed.

    Args:
        anatomy: the undeformed patient.
        mesh: its mesh, breast frame.
        deformed: the mesh's nodes (N, 3) between the plates, turned back into the breast frame, mm.
    """

    def __init__(self, anatomy: Anatomy, mesh: PhantomMesh, deformed: Array) -> None:
        self.anatomy, self.mesh, self.deformed = anatomy, mesh, deformed
        self.nipple_motion = self._skin_motion(anatomy.shape.tip + np.array([0.0, 2.0, 0.0]))

    def forward(self, points: Array) -> Array:
        """Places (N, 3) between the plates of undeformed points (N, 3) in the meshed breast, mm."""
        element, local, _ = Locator(self.mesh.points, self.mesh.hexes).locate(points)
        return interpolate(self.mesh.hexes, element, local, self.deformed)

    @property
    def nipple(self) -> Array:
        """Place (3,) of the nipple's tip: the nipple rides rigidly on the skin."""
        motion = self.nipple_motion
        return np.asarray(motion.foot + motion.turn @ (self.anatomy.shape.nipple - motion.start))

    def _skin_motion(self, point: Array) -> Motion:
        """Rigid part of the motion of the tissue at a point (3,)."""
        element, local, _ = Locator(self.mesh.points, self.mesh.hexes).locate(point[None])
        corners = self.mesh.hexes[element]
        before = _jacobian(self.mesh.points[corners], local)[0]
        after = _jacobian(self.deformed[corners], local)[0]
        u, _, vt = np.linalg.svd(after @ np.linalg.inv(before))
        return Motion(u @ vt, point, interpolate(self.mesh.hexes, element, local, self.deformed)[0])

    def tabulated(self, lowest: Array, highest: Array) -> "OriginMap":
        """Origins of all places in a box, for images."""
        counts = np.ceil((highest - lowest) / MAP_SPACING_MM).astype(int) + 1
        grid = Volume(np.zeros(tuple(counts), dtype=bool), np.asarray(lowest, dtype=float), np.full(3, MAP_SPACING_MM))
        places = grid.to_world(np.argwhere(~grid.data))
        locator = Locator(self.deformed, self.mesh.hexes)
        pieces = [self._shift(piece, locator) for piece in np.array_split(places, 1 + len(places) // PIECE)]
        shift, away = (np.concatenate(column) for column in zip(*pieces, strict=True))
        tables = [grid.with_data(column.reshape(grid.shape).astype(np.float32)) for column in (*shift.T, away)]
        return OriginMap(self.anatomy, (tables[0], tables[1], tables[2]), tables[3], self.nipple_motion)

    def _shift(self, places: Array, locator: Locator) -> tuple[Array, Array]:
        """Origin minus place (N, 3) and the distance (N,) from the deformed breast, both in mm.

        The map continues linearly just outside the skin, so that the skin's place between grid points is right;
        farther away, in the chest, the motion of the nearest tissue fades.
        """
        element, local, inside = locator.locate(places)
        edge = np.clip(local, -1.0, 1.0)
        nearest = interpolate(self.mesh.hexes, element, edge, self.deformed)
        shift = interpolate(self.mesh.hexes, element, edge, self.mesh.points) - nearest
        beyond = places - nearest
        away = np.where(inside, 0.0, np.linalg.norm(beyond, axis=1))
        near = np.flatnonzero((away > 0.0) & (away < NEAR_MM))
        corners = self.mesh.hexes[element[near]]
        before = _jacobian(self.mesh.points[corners], edge[near])
        after = _jacobian(self.deformed[corners], edge[near])
        continued = np.einsum("nij,nj->ni", before, np.linalg.solve(after, beyond[near][..., None])[..., 0])
        fading = np.exp(-np.maximum(away - NEAR_MM, 0.0) / FADE_MM)
        shift *= fading[:, None]
        shift[near] += np.clip(continued - beyond[near], -NEAR_MM, NEAR_MM)
        return shift, away


@dataclass(frozen=True)
class OriginMap:
    """Tissue of the deformed patient from a table of origins.

    Attributes:
        anatomy: the undeformed patient.
        shift: the three components of origin minus place, mm.
        away: distance from the deformed breast, mm.
        nipple: motion of the nipple.
    """

    anatomy: Anatomy
    shift: tuple[Volume, Volume, Volume]
    away: Volume
    nipple: Motion

    def at(self, places: Array) -> Tissue:
        """Tissue at places (N, 3) of the deformed patient in the breast frame, mm."""
        origins = places + np.column_stack([table.sample(places) for table in self.shift])
        vacant = self._vacated(origins, self.away.sample(places))
        near = np.flatnonzero((np.abs(places - self.nipple.foot) < 15.0).all(axis=1))
        rigid = self.nipple.start + (places[near] - self.nipple.foot) @ self.nipple.turn
        in_nipple = self.anatomy.shape.nipple_level(*rigid.T) > 0.0
        origins[near[in_nipple]] = rigid[in_nipple]
        vacant[near[in_nipple]] = False
        tissue = self.anatomy.at(origins)
        kind = np.where(vacant, AIR, tissue.kind).astype(np.uint8)
        here = (~vacant).astype(np.float32)
        return Tissue(kind, tissue.gland * here, tissue.lesion * here)

    def _vacated(self, origins: Array, away: Array) -> NDArray[np.bool_]:
        """Places in the air whose faded motion points back into the breast."""
        in_front = origins[:, 1] < self.anatomy.shape.back(origins[:, 0], origins[:, 2])
        return np.asarray((away > 0.8 * NEAR_MM) & in_front)


def _jacobian(corners: Array, local: Array) -> Array:
    """Jacobians (N, 3, 3) of elements with corners (N, 8, 3), each at its own local coordinates (N, 3)."""
    return np.asarray(np.einsum("nac,nad->ncd", corners, shape_gradients(local)))
