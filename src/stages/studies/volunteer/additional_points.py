"""The paper's "additional points" (section II-C, Table III): points of the skin known in both volumes draw it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.errors import DataError
from mammoreg.fem.parts.point_ties import point_ties
from mammoreg.fem.plates.closing import Closed
from mammoreg.geometry import breast_to_plate, lps_to_breast
from mammoreg.geometry.quads import area_vectors
from mammoreg.shape.surface_points import nearest_on_skin
from stages.annotations import mr_landmarks
from stages.compress.record import CompressRecord
from stages.engine.contract import Inputs
from stages.studies.volunteer.case import VolunteerCase

REST_DAMPING = 0.05
ROUNDS = 2
FARTHEST_MM = 4.0  # three voxels of the working grid


@dataclass(frozen=True)
class Drawn:
    """A breast between the plates whose skin has been drawn to points.

    Attributes:
        deformed: nodes (N, 3), plate frame, mm.
        closed: the same in its own height, with its report.
        points: number of tied points.
        left_mm: their mean distance from their targets.
    """

    deformed: Points
    closed: Closed
    points: int
    left_mm: float

    def report(self) -> dict[str, Any]:
        """Of the solve, by the names of stage `compress`."""
        closed = self.closed
        found = {"force_n": 0.5 * sum(closed.force_n), "iterations": closed.iterations, "load_steps": closed.steps}
        return found | {
            "min_det_f": closed.min_det_f,
            "volume_change": closed.volume_change,
            "points": self.points,
            "points_left_mm": self.left_mm,
        }


def surface_points(inputs: Inputs, case: VolunteerCase) -> tuple[Points, Points] | None:
    """Points (P, 3) of the skin before and between the plates, breast frame; None where the table names none."""
    before, after = mr_landmarks(inputs, "mr_surface_points"), mr_landmarks(inputs, "mr_compressed_surface_points")
    names = [name for name in before if name in after]
    if not names:
        return None
    start, goal = (lps_to_breast(np.array([of[n] for n in names]), case.pose.laterality) for of in (before, after))
    return start, goal


def draw_to_points(
    case: VolunteerCase, compress: CompressRecord, points: tuple[Points, Points], stiffness: float
) -> Drawn:
    """Go on from `compress` with points of the skin tied to where the second volume shows them.

    Where the model lies in the second volume is known by the fit of its outline, which the ties change; so they are
    tied twice. A point farther from the mesh's skin than `FARTHEST_MM` lies on skin that the mesh does not have, and
    is left out.

    Args:
        case: the volunteer.
        compress: of the main run.
        points: as `surface_points` gives them.
        stiffness: of a point's springs, in units of the shear modulus times the size of a skin face.

    Raises:
        DataError: none of the points lies on the mesh's skin.
        NotConvergedError: with the reason.
    """
    start, goal = points
    frame, block = compress.frame, case.mesh.block
    closing, closed = compress.resumed(block)
    corners, shares = nearest_on_skin(block.points, block.skin_quads(), start)
    away = np.linalg.norm(np.einsum("pa,pai->pi", shares, block.points[corners]) - start, axis=1)
    near = away < FARTHEST_MM
    if not near.any():
        raise DataError(f"no surface point lies within {FARTHEST_MM:g} mm of the mesh's skin; check mr_surface_points")
    corners, shares, start, goal = corners[near], shares[near], start[near], goal[near]
    constant = stiffness * compress.mu_kpa * _face_mm(case)
    for _ in range(ROUNDS):
        deformed = frame.to_plate(closed.deformed)
        skin, way = np.einsum("pa,pai->pi", shares, deformed[corners]), case.way(deformed)
        # The points lie a little off the mesh's skin, and stay so.
        off = way.deformation.forward(start) - skin
        targets = frame.from_plate(_in_plate_frame(case, deformed, goal) - off)
        ties = point_ties(closing.points, corners, shares, targets, constant)
        closed = closing.rest(closed, ties, REST_DAMPING)
    left = np.linalg.norm(ties.points(closed.deformed) - targets, axis=1)
    return Drawn(frame.to_plate(closed.deformed), closed, len(left), float(left.mean()))


def _in_plate_frame(case: VolunteerCase, deformed: Points, goal: Points) -> Points:
    """Where points (P, 3) of the second volume lie in the plate frame of the deformed nodes."""
    way, drawn = case.way(deformed), case.pose.drawn_mm
    placed = goal - case.second.shift(way, drawn)
    return np.asarray(breast_to_plate(placed, way.geometry.angle_deg) - drawn)


def _face_mm(case: VolunteerCase) -> float:
    """Side of the skin's mean face."""
    areas = area_vectors(case.mesh.block.points, case.mesh.block.skin_quads())
    return float(np.sqrt(np.linalg.norm(areas, axis=1).mean()))
