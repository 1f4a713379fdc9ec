"""Deformations: maps between the undeformed breast (breast frame) and the breast between the plates (plate frame)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.locate import Locator, interpolate
from mammoreg.meshing.trilinear import shape_gradients

_FAR_MM = 1e-3


class Deformation(Protocol):
    """A one-to-one map of the undeformed breast onto the breast as a view shows it."""

    def forward(self, points_breast: Points) -> Points:
        """Carry points (N, 3) of the undeformed breast, breast frame, mm, to the plate frame, mm."""
        ...

    def inverse(self, points_plate: Points) -> Points:
        """Carry points (N, 3) of the plate frame back to the breast frame; nan where there is no breast."""
        ...


@dataclass(frozen=True)
class AffineDeformation:
    """x -> matrix x + offset: methods `rigid` and `scaling`. It has no border, so its inverse is never nan."""

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]

    def forward(self, points_breast: Points) -> Points:
        """See `Deformation.forward`."""
        return np.asarray(points_breast, dtype=float) @ self.matrix.T + self.offset

    def inverse(self, points_plate: Points) -> Points:
        """See `Deformation.inverse`."""
        return np.asarray(
            np.linalg.solve(self.matrix, (np.asarray(points_plate, dtype=float) - self.offset).T).T, float
        )


class ReferenceMesh:
    """The undeformed mesh (breast frame), shared by all views and methods of a case.

    It remembers where the last set of points lies, because every view and method asks for the same voxels.
    """

    def __init__(self, points: Points, hexes: NDArray[np.intp]) -> None:
        self.points = np.asarray(points, dtype=float)
        self.hexes = hexes
        self._locator = Locator(self.points, hexes)
        self._asked: Points | None = None
        self._located: tuple[NDArray[np.intp], Points] | None = None

    def locate(self, points: Points) -> tuple[NDArray[np.intp], Points]:
        """Element (N,) and local coordinates (N, 3) of points (N, 3); see `Locator.locate` for those outside."""
        if self._located is None or self._asked is None or not np.array_equal(self._asked, points):
            element, local, _ = self._locator.locate(points)
            self._asked, self._located = np.array(points, dtype=float), (element, local)
        return self._located

    def carry(self, points: Points, deformed: Points) -> Points:
        """Carry points (N, 3) with the nodes; what lies beyond the extrapolated elements turns with the nearest."""
        element, local = self.locate(points)
        carried = np.asarray(interpolate(self.hexes, element, local, deformed))
        beyond = points - interpolate(self.hexes, element, local, self.points)
        far = np.flatnonzero(np.linalg.norm(beyond, axis=1) > _FAR_MM)
        if len(far):
            turn = self._turns(element[far], local[far], deformed)
            carried[far] += np.einsum("nij,nj->ni", turn, beyond[far])
        return carried

    def _turns(self, element: NDArray[np.intp], local: Points, deformed: Points) -> NDArray[np.float64]:
        """Rotations (N, 3, 3) of the deformation gradients at places within elements."""
        gradients = shape_gradients(np.clip(local, -1.0, 1.0))
        before, after = (
            np.einsum("nac,nad->ncd", nodes[self.hexes[element]], gradients) for nodes in (self.points, deformed)
        )
        left, _, right = np.linalg.svd(after @ np.linalg.inv(before))
        return np.asarray(left @ right)


@dataclass(frozen=True)
class MeshDeformation:
    """The deformation of a finite element solution: methods `plate`, `updated` and their kin.

    Attributes:
        reference: the undeformed mesh.
        deformed: the same nodes between the plates, (nodes, 3), plate frame, mm.
    """

    reference: ReferenceMesh
    deformed: Points

    @cached_property
    def _deformed_locator(self) -> Locator:
        return Locator(self.deformed, self.reference.hexes)

    def forward(self, points_breast: Points) -> Points:
        """See `Deformation.forward`; points outside the mesh follow its nearest element."""
        return self.reference.carry(np.asarray(points_breast, dtype=float), self.deformed)

    def inverse(self, points_plate: Points) -> Points:
        """See `Deformation.inverse`."""
        element, local, inside = self._deformed_locator.locate(points_plate)
        breast = interpolate(self.reference.hexes, element, local, self.reference.points)
        breast[~inside] = np.nan
        return breast


@dataclass(frozen=True)
class MethodView:
    """How one method sees one view: the deformation into the plate frame, and what projects from there."""

    deformation: Deformation
    geometry: ViewGeometry

    def project(self, points_breast: Points) -> NDArray[np.float64]:
        """Pixels (N, 2) as (column, row), canonical image, of points (N, 3) of the undeformed breast, mm."""
        return self.geometry.project(self.deformation.forward(points_breast))
