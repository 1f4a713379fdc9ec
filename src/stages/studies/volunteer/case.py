"""A case with landmarks in two MR volumes: what any deformation of its breast does to them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mammoreg.geometry import lps_to_breast
from mammoreg.geometry.frames import Laterality, Points
from mammoreg.localization.deformation import MeshDeformation, MethodView, ReferenceMesh
from mammoreg.localization.to_compressed import SecondVolume
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact
from stages.engine.contract import Inputs
from stages.evaluate.elongation import elongation_rows
from stages.localize.to_compressed import drawn_mm, second_volume, view_in_second_volume
from stages.marks import mr_landmarks
from stages.methods import block_mesh, view_geometry

BASE_MM = 1.0
"""Slopes over this base let two variations that differ little be placed alike, to some hundredths of a millimetre."""


@dataclass(frozen=True)
class Landmarks:
    """Landmarks of both volumes, breast frame, mm: names, `before` (L, 3) and `after` (L, 3) the compression."""

    names: Sequence[str]
    before: Points
    after: Points

    def translated(self) -> Points:
        """The best translation of all, which knows the truth."""
        return np.asarray(self.before + (self.after - self.before).mean(axis=0))

    def rows(self, key: str, name: str, places: Points | None) -> list[dict[str, Any]]:
        """Distances of places (L, 3) from the truth, and their part from side to side, mm; empty without places."""
        misses = [None] * len(self.names) if places is None else list(places - self.after)
        return [
            {
                key: name,
                "landmark": landmark,
                "distance_mm": None if miss is None else float(np.linalg.norm(miss)),
                "lateral_mm": None if miss is None else float(abs(miss[0])),
            }
            for landmark, miss in zip(self.names, misses, strict=True)
        ]


@dataclass(frozen=True)
class VolunteerCase:
    """A volunteer's breast and what shows where its parts came to lie.

    Attributes:
        pose: of the view that the second volume shows.
        block: undeformed mesh, breast frame.
        reference: the same, ready to carry points.
        second: what places results.
        landmarks: in both volumes.
    """

    pose: Artefact
    block: BlockMesh
    reference: ReferenceMesh
    second: SecondVolume
    landmarks: Landmarks

    def way(self, deformed: Points) -> MethodView:
        """Deformed nodes (N, 3), plate frame, as a method."""
        return MethodView(MeshDeformation(self.reference, deformed), view_geometry(self.pose))

    def placed(self, deformed: Points) -> Points:
        """The landmarks (L, 3) where deformed nodes put them in the second volume, breast frame."""
        return self.second.place(self.way(deformed), drawn_mm(self.pose), self.landmarks.before)

    def elongations(self, deformed: Points) -> Mapping[str, float | None]:
        """Elongation by direction of deformed nodes, with `true_` before it that of the second volume, mm."""
        found: dict[str, float | None] = {}
        for row in elongation_rows(self.pose, self.block, {"plate": self.way(deformed)}):
            found |= {f"{row['direction']}_mm": row["elongation_mm"], f"true_{row['direction']}_mm": row["true_mm"]}
        return found


def volunteer_landmarks(inputs: Inputs, side: Laterality) -> Landmarks | None:
    """Landmarks that both volumes name, None without any."""
    before, after = mr_landmarks(inputs), mr_landmarks(inputs, "mr_compressed_landmarks")
    names = [name for name in before if name in after]
    if not names:
        return None
    return Landmarks(names, *(lps_to_breast(np.array([of[n] for n in names]), side) for of in (before, after)))


def volunteer_case(inputs: Inputs, landmarks: Landmarks) -> VolunteerCase | str:
    """The case or, where its stages did not come so far, why not."""
    for artefact in (a for name in ("segment", "mesh") for a in inputs.artefacts(name)):
        if not artefact.ok:
            return artefact.message
    poses = {str(pose.view): pose for pose in inputs.artefacts("pose")}
    view = view_in_second_volume(poses)
    segment, block = inputs.artefact("segment"), block_mesh(inputs.artefact("mesh"))
    second = second_volume(segment, block)
    if view is None or second is None:
        return "no second volume shows the compression"
    if not poses[view].ok:
        return poses[view].message
    placing = replace(second, base_mm=BASE_MM)
    return VolunteerCase(poses[view], block, ReferenceMesh(block.points, block.hexes()), placing, landmarks)
