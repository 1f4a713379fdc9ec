"""A case with landmarks in two MR volumes: what any deformation of its breast does to them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import MeshDeformation, MethodView
from mammoreg.localization.to_compressed import SecondVolume
from stages.annotations import mr_landmarks
from stages.elongation import elongation_rows
from stages.engine.completion import first_failure
from stages.engine.contract import Inputs
from stages.mesh.record import MeshRecord
from stages.pose.record import PoseRecord
from stages.second_volume import second_volume, view_in_second_volume
from stages.segment.record import SegmentRecord

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
        mesh: undeformed.
        second: what places results.
        landmarks: in both volumes.
    """

    pose: PoseRecord
    mesh: MeshRecord
    second: SecondVolume
    landmarks: Landmarks

    def way(self, deformed: Points) -> MethodView:
        """Deformed nodes (N, 3), plate frame, as a method."""
        return MethodView(MeshDeformation(self.mesh.reference, deformed), self.pose.geometry)

    def placed(self, deformed: Points) -> Points:
        """The landmarks (L, 3) where deformed nodes put them in the second volume, breast frame."""
        return self.second.place(self.way(deformed), self.pose.drawn_mm, self.landmarks.before)

    def elongations(self, deformed: Points) -> Mapping[str, float | None]:
        """Elongation by direction of deformed nodes, with `true_` before it that of the second volume, mm."""
        found: dict[str, float | None] = {}
        for row in elongation_rows(self.pose, self.mesh.block, {"plate": self.way(deformed)}):
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
    if failure := first_failure(inputs.artefact(name) for name in ("segment", "mesh")):
        return str(failure)
    poses = {str(pose.view): pose for pose in inputs.artefacts("pose")}
    view = view_in_second_volume(poses)
    segment, mesh = SegmentRecord(inputs.artefact("segment")), MeshRecord(inputs.artefact("mesh"))
    second = second_volume(segment, mesh.block)
    if view is None or second is None:
        return "no second volume shows the compression"
    if not poses[view].ok:
        return poses[view].message
    placing = replace(second, base_mm=BASE_MM)
    return VolunteerCase(PoseRecord(poses[view]), mesh, placing, landmarks)
