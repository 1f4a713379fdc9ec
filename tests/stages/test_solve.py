"""Stage `solve`: the interior under the estimated surface."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.fem.plates.state import DampedState
from stages.engine.artefact import Array, Artefact, write_artefact
from stages.shape.record import ShapeRecord, shape_fields
from tests.stages.pressed_case import MESH, run, write_pose, write_start
from tests.stages.synthetic_case import header

SKIN = MESH.skin_nodes()
INNER = np.setdiff1d(np.arange(len(MESH.points)), np.union1d(SKIN, MESH.back_nodes()))


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chain")
    start, pose = write_start(folder), write_pose(folder / "pose.h5", wider_mm=2.0, height_mm=-20.0)
    found = {"mesh": start["mesh"], "pose": pose}
    found["compress"] = run("compress", folder / "out", found | {"calibrate": start["calibrate"]}).path
    found["shape"] = run("shape", folder / "out", found).path
    return {name: path for name, path in found.items() if name != "pose"}


def _moved(path, shape, motion):
    """The shape's surface moved, and nothing else of it."""
    kept = ShapeRecord(shape)
    nodes = kept.deformed.copy()
    nodes[kept.surface_nodes] += motion
    fields = shape_fields(kept.surface_nodes, nodes, DampedState(nodes, kept.pressure, 0.0, kept.memory), {})
    # The solve starts from where the shape was, so that only the surface pulls.
    arrays = {**fields.arrays, "deformed": Array(kept.deformed, "mm", "where the solve starts")}
    write_artefact(path, header("shape", "R", "CC"), replace(fields, arrays=arrays))
    return path


def test_interior_is_that_of_the_shape(chain, tmp_path):
    shape, got = Artefact(chain["shape"]), run("solve", tmp_path, chain)
    assert got.ok, got.message
    before, after = shape.array("deformed", "mm"), got.array("deformed", "mm")
    np.testing.assert_allclose(after[SKIN], before[SKIN], atol=1e-9)
    assert np.linalg.norm(after[INNER] - before[INNER], axis=1).max() < 0.3, "the ties act on the skin alone"
    assert abs(got.value("volume_change")) < 0.01
    assert got.value("min_det_f") > 0.2
    assert got.value("residuals")[-1] < 1e-4


def test_plates_press_as_where_the_surface_was_estimated(chain, tmp_path):
    """The force that holds the surface, with the contact beside it, is the contact force of `shape`."""
    compress, shape, got = Artefact(chain["compress"]), Artefact(chain["shape"]), run("solve", tmp_path, chain)
    assert got.value("thickness_mm") == compress.value("thickness_mm")
    forces = [shape.value(f"force_{plate}_n") for plate in ("lower", "upper")]
    assert got.value("force_lower_n") == pytest.approx(forces[0], rel=0.02)
    assert got.value("force_upper_n") == pytest.approx(forces[1], rel=0.02)
    assert got.value("force_n") == pytest.approx(np.mean([got.value("force_lower_n"), got.value("force_upper_n")]))
    assert forces[0] > 1.0
    assert not got.value("contact_lost")


def test_interior_follows_another_surface(chain, tmp_path):
    """A bulge drawn out at the nipple moves the tissue behind it, and less of it the deeper it lies."""
    shape = Artefact(chain["shape"])
    plain = run("solve", tmp_path / "a", chain).array("deformed", "mm")
    cap = np.exp(-(((shape.array("surface", "mm") - plain[:, :].min(axis=0)) / 60.0) ** 2)[:, 1])
    motion = np.stack([np.zeros(len(cap)), -2.0 * cap, np.zeros(len(cap))], axis=1)
    other = chain | {"shape": _moved(tmp_path / "shape.h5", shape, motion)}
    got = run("solve", tmp_path / "b", other)
    assert got.ok, got.message
    moved = (got.array("deformed", "mm") - plain)[:, 1]
    grid = MESH.node_grid()
    deep = [moved[grid[1:-1, 1:-1, k].ravel()].mean() for k in range(MESH.n + 1)]
    assert deep[-1] == pytest.approx(-2.0, abs=0.3)
    assert (np.diff(deep) < 0.0).all()


def test_surface_turned_inside_out_ends_with_a_status(chain, tmp_path):
    shape = Artefact(chain["shape"])
    surface = shape.array("surface", "mm")
    crushed = np.stack([0.0 * surface[:, 0], 0.0 * surface[:, 1], -1.6 * (surface[:, 2] + 20.0)], axis=1)
    got = run("solve", tmp_path / "out", chain | {"shape": _moved(tmp_path / "s.h5", shape, crushed)})
    assert got.status == "not_converged"
    assert got.message.startswith("solve: ")
