"""A breast whose back bends forward above, in front of the plates' edge, as real ones do."""

import numpy as np
import pytest

from mammoreg.contact.plate import Plate
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import write_artefact
from stages.mesh.record import mesh_fields
from tests.stages.pressed_case import EDGE, GAP, run, write_pose, write_start
from tests.stages.synthetic_case import header
from tests.unit.block_meshes import half_ellipsoid

FORWARD_MM = 45.0


def _bent():
    """The pressed case's breast, finer, with its upper back drawn forward and the elements along."""
    upright = half_ellipsoid(8, (60.0, 78.0, 48.0))
    points = upright.points.copy()
    above = np.clip(points[:, 2] / points[:, 2].max(), 0.0, None)
    points[:, 1] -= FORWARD_MM * above**2 * (1.0 + points[:, 1] / 78.0)
    return BlockMesh(upright.n, points)


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bent")
    found = {"calibrate": write_start(folder)["calibrate"], "mesh": folder / "bent.h5"}
    write_artefact(found["mesh"], header("mesh", "R"), mesh_fields(_bent(), "R", {}))
    found["pose"] = write_pose(folder / "pose.h5")
    for stage, of in (("compress", ("calibrate", "mesh", "pose")), ("shape", ("mesh", "pose", "compress"))):
        found[stage] = run(stage, folder / stage, {name: getattr(found[name], "path", found[name]) for name in of})
    found["solve"] = run(
        "solve", folder / "solve", {n: getattr(found[n], "path", found[n]) for n in ("mesh", "compress", "shape")}
    )
    return found


def _deepest(artefact, height_mm):
    """Depth of the deepest node of skin or back in the plates, their rounded lips included, mm."""
    points = artefact.array("deformed", "mm")[np.union1d(_bent().skin_nodes(), _bent().back_nodes())]
    return max(-Plate(h, up, EDGE, 8.0).gap(points).distance.min() for h, up in ((height_mm, 1), (height_mm + GAP, -1)))


def _inside_the_plates(artefact, height_mm):
    """Depth (B,) of back nodes in the plates, mm, those in front of the plates' lips."""
    back = artefact.array("deformed", "mm")[_bent().back_nodes()]
    height = back[back[:, 1] < EDGE - 8.0, 2] - height_mm
    assert len(height) > 4, "the back must lie between the plates for this test to say anything"
    return np.maximum(-height, height - GAP)


def test_back_between_the_plates_stays_out_of_them(chain):
    height_mm = chain["compress"].value("height_mm")
    for stage in ("compress", "shape", "solve"):
        assert chain[stage].ok, chain[stage].message
        assert _inside_the_plates(chain[stage], height_mm).max() < 1.5


def test_solve_keeps_the_plates_under_their_lips_too(chain):
    height_mm = chain["compress"].value("height_mm")
    shape, solve = (_deepest(chain[stage], height_mm) for stage in ("shape", "solve"))
    assert solve <= shape + 0.1
    assert chain["solve"].value("penetration_mm") <= chain["shape"].value("penetration_mm") + 0.1
    assert chain["solve"].value("penetration_mm") > solve - 0.01, "corners are contact points"


def test_surface_holds_the_back_that_the_plates_press(chain):
    nodes = chain["shape"].array("surface_nodes", "1")
    skin, back = _bent().skin_nodes(), _bent().back_nodes()
    assert np.isin(skin, nodes).all()
    pressed = np.setdiff1d(nodes, skin)
    assert len(pressed) > 0
    assert np.isin(pressed, back).all()
