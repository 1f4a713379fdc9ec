"""Springs that draw points of the skin to places."""

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import back_condition
from mammoreg.fem.parts.point_ties import point_ties
from mammoreg.fem.plates.closing import Closing
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block

MESH = block(4)
MODEL = HyperelasticModel(MESH.points, MESH.hexes(), neo_hookean(10.0, 0.49))


def test_stiff_ties_bring_points_to_their_places_between_the_plates() -> None:
    back = back_condition("slide_compression", MESH.points, MESH.back_quads(), along_kpa_per_mm=0.1)
    free = Closing(MODEL, MESH.skin_quads(), back).close(48.0)
    front = MESH.skin_quads()[-16:]
    corners, shares = front[[5, 10]], np.array([[0.25, 0.25, 0.25, 0.25], [0.7, 0.1, 0.1, 0.1]])
    there = np.einsum("ta,tai->ti", shares, free.deformed[corners])
    targets = there + np.array([[2.0, -1.0, 0.0], [-1.5, 1.0, 0.0]])
    misses = []
    for stiffness in (100.0, 100000.0):
        ties = point_ties(MESH.points, corners, shares, targets, stiffness)
        closed = Closing(MODEL, MESH.skin_quads(), back, parts=[ties]).close(48.0)
        misses.append(np.linalg.norm(ties.points(closed.deformed) - targets, axis=1).max())
        assert closed.gap_mm == 48.0
    assert misses[1] < 0.05 < misses[0]


def test_points_beside_their_faces_and_slack_springs_are_refused() -> None:
    corners, targets = MESH.skin_quads()[:1], np.zeros((1, 3))
    with pytest.raises(ValueError, match="lie on their faces"):
        point_ties(MESH.points, corners, np.array([[1.2, -0.2, 0.0, 0.0]]), targets, 1.0)
    with pytest.raises(ValueError, match="positive stiffness"):
        point_ties(MESH.points, corners, np.full((1, 4), 0.25), targets, 0.0)
