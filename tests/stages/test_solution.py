"""Facts of deformed meshes that artefacts keep: folded corners, sideways drift, lost contact."""

import numpy as np
import pytest

from mammoreg.geometry import breast_to_lps, breast_to_plate
from stages.engine.artefact import Artefact
from stages.mesh.record import MeshRecord
from stages.solution import force_values, mesh_values
from tests.stages.synthetic_case import box, write_mesh

ANGLE = 30.0


@pytest.fixture(params=["L", "R"])
def mesh(request, tmp_path):
    return MeshRecord(Artefact(write_mesh(tmp_path / "mesh.h5", request.param)))


def _turned():
    return breast_to_plate(box().points, ANGLE)


def test_sound_mesh_has_no_folded_corner(mesh):
    found = mesh_values(mesh, _turned() * [1.2, 1.2, 0.7], ANGLE)
    assert (found["folded_corners"], found["folded_share"], found["folded_corner_points"]) == (0, 0.0, [])


def test_corner_pushed_through_its_element_is_counted_and_placed(mesh):
    """The body's own corner belongs to one element; its place is the patient's, before compression."""
    block, nodes = box(), _turned()
    corner = int(block.node_grid()[0, 0, -1])
    element = np.flatnonzero((block.hexes() == corner).any(axis=1))
    assert len(element) == 1
    centre = nodes[block.hexes()[element[0]]].mean(axis=0)
    nodes[corner] += 1.4 * (centre - nodes[corner])
    found = mesh_values(mesh, nodes, ANGLE)
    assert found["folded_corners"] >= 1
    assert found["folded_share"] == pytest.approx(1 / len(block.hexes()))
    expected = breast_to_lps(block.points[corner], mesh.laterality)
    assert np.abs(np.array(found["folded_corner_points"]) - expected).max(axis=1).min() < 0.01


def test_drift_is_the_bodys_beside_its_backs(mesh):
    nodes = _turned()
    shifted = nodes + np.array([6.0, 1.0, -2.0])
    assert mesh_values(mesh, shifted, ANGLE)["sideways_drift_mm"] == pytest.approx(0.0, abs=1e-9)
    depth = (nodes[:, 1].max() - nodes[:, 1]) / np.ptp(nodes[:, 1])
    tipped = nodes + np.outer(depth, [-8.0, 0.0, 0.0])
    # Linear in depth, of a box: on average half of what the front has moved.
    assert mesh_values(mesh, tipped, ANGLE)["sideways_drift_mm"] == pytest.approx(-4.0, abs=1e-9)
    spread = nodes * [1.3, 1.0, 1.0]
    assert mesh_values(mesh, spread, ANGLE)["sideways_drift_mm"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("forces", "lost"), [((40.0, 41.0), False), ((3.4, 18.1), False), ((0.0, 20.0), True)])
def test_a_plate_without_force_has_lost_the_breast(forces, lost):
    found = force_values(forces)
    assert (found["contact_lost"], found["force_n"]) == (lost, sum(forces) / 2)
