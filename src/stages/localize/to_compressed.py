"""Into the compressed MR volume: landmarks carried by each method, placed by that volume's outline alone."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mammoreg.geometry import Volume, lps_to_breast, plate_to_breast
from mammoreg.geometry.frames import Laterality, Points
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.to_compressed import fit_surface_to_outline, signed_distance
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact, Fields
from stages.localize.views import CaseViews
from stages.methods import METHODS

_SKIN_PARTS = 2


@dataclass(frozen=True)
class SecondVolume:
    """The compressed volume as what is placed in it knows it, breast frame, mm.

    Attributes:
        mask: the body between the plates.
        skin: points (N, 3) on the undeformed skin.
        base_mm: of `fit_surface_to_outline`, for the shift.
    """

    mask: Volume
    skin: Points
    base_mm: float | None = None

    @cached_property
    def outline(self) -> Volume:
        """Signed distance from the body's surface."""
        return signed_distance(self.mask)

    def rigid(self, points: Points) -> Points:
        """Points (N, 3) of the undeformed breast by the best rigid fit of its skin."""
        return fit_surface_to_outline(self.skin, self.outline, rotate=True).forward(points)

    def place(self, way: MethodView, drawn_mm: Sequence[float], points: Points) -> Points:
        """Points (N, 3) of the undeformed breast where a method and the mask put them."""
        return drawn_to_breast(way, drawn_mm, points) + self.shift(way, drawn_mm)

    def shift(self, way: MethodView, drawn_mm: Sequence[float]) -> Points:
        """Displacement (3,) by which the mask places what a method has deformed."""
        surface = drawn_to_breast(way, drawn_mm, self.skin)
        return fit_surface_to_outline(surface, self.outline, rotate=False, base_mm=self.base_mm).offset


def second_volume(segment: Artefact, block: BlockMesh) -> SecondVolume | None:
    """The second volume of a case, None without one."""
    if "compressed_mask" not in segment.volume_names():
        return None
    mask = segment.volume("compressed_mask").between_lps_and_breast(segment.laterality)
    fine = block.subdivide(_SKIN_PARTS)
    return SecondVolume(mask, np.asarray(fine.points[fine.skin_nodes()]))


def view_in_second_volume(views: Container[str]) -> str | None:
    """The view whose compression the second volume shows."""
    return next((view for view in ("3D", "CC", "MLO") if view in views), None)


def drawn_mm(pose: Artefact) -> Sequence[float]:
    """How far (3,) the pose has seen the breast drawn over the plates, plate axes; a mammogram does not tell."""
    return list(pose.value("drawn_mm")) if pose.view == "3D" else [0.0, 0.0, 0.0]


def drawn_to_breast(way: MethodView, drawn: Sequence[float], points: Points) -> Points:
    """Points (N, 3) of the undeformed breast between the plates, breast frame, from where the breast was drawn to."""
    return plate_to_breast(way.deformation.forward(points) + np.asarray(drawn), way.geometry.angle_deg)


def predict_in_compressed(
    views: CaseViews, second: SecondVolume, landmarks: Mapping[str, Points], laterality: Laterality
) -> Fields:
    """Rows `compressed_rows` (LPS).

    The deformed breast is shifted to the second volume's outline; `rigid` is the best rigid fit of the undeformed
    skin to it.

    Args:
        views: of the case.
        second: what places results.
        landmarks: points (3,) of the undeformed volume by name, breast frame.
    """
    view = view_in_second_volume(views.methods)
    rows: list[dict[str, Any]] = []
    points = np.array(list(landmarks.values())).reshape(-1, 3)
    if view is None or not landmarks:
        return Fields(values={"compressed_rows": rows})
    for method in METHODS:
        if method == "rigid":
            carried = second.rigid(points)
        elif method in views.methods[view]:
            carried = second.place(views.methods[view][method], drawn_mm(views.poses[view]), points)
        else:
            carried = np.full(points.shape, np.nan)
        rows += _rows(method, list(landmarks), lps_to_breast(carried, laterality))
    return Fields(values={"compressed_rows": rows})


def _rows(method: str, names: list[str], points: Points) -> list[dict[str, Any]]:
    return [
        {"method": method, "name": name, **dict(zip("xyz", map(float, point), strict=True))}
        for name, point in zip(names, points, strict=True)
    ]
