"""Stage `shape`: from the compression and an outline to the surface of the breast."""

import json
import shutil

import h5py
import numpy as np
import pytest

from tests.stages.pressed_case import EDGE, MESH, run, write_pose, write_start
from tests.stages.synthetic_case import write_failed


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    start, pose = write_start(folder), write_pose(folder / "pose.h5")
    chain = {"mesh": start["mesh"], "calibrate": start["calibrate"], "pose": pose}
    compress = run("compress", folder / "out", chain)
    return {"mesh": start["mesh"], "pose": pose, "compress": compress.path}, compress


def _shaped(inputs, tmp_path, settings=None, **pose):
    return run("shape", tmp_path / "out", inputs[0] | {"pose": write_pose(tmp_path / "p.h5", **pose)}, settings)


def test_outline_of_the_same_breast_changes_nothing(inputs, tmp_path):
    got = _shaped(inputs, tmp_path)
    assert got.ok, got.message
    assert got.value("rounds") == 0
    np.testing.assert_allclose(got.array("deformed", "mm"), inputs[1].array("deformed", "mm"), atol=1e-9)


@pytest.mark.parametrize("wider_mm", [2.0, -1.5])
def test_surface_reaches_the_outline_between_the_same_plates(inputs, tmp_path, wider_mm):
    got = _shaped(inputs, tmp_path, wider_mm=wider_mm)
    assert got.ok, got.message
    assert got.value("outline_before_mean_mm") == pytest.approx(abs(wider_mm), abs=0.3)
    assert got.value("outline_after_mean_mm") < 0.2
    assert got.value("outline_after_p95_mm") < 0.5
    assert got.value("contact_drift_mm") < 1.0
    assert abs(got.value("volume_change")) < 0.01
    assert got.value("min_det_f") > 0.2
    # The plates stay while the ties draw towards or away from the source, so that their forces differ a little.
    assert got.value("force_lower_n") == pytest.approx(got.value("force_upper_n"), rel=0.1)
    assert got.value("force_lower_n") > 1.0
    assert abs(got.value("sideways_drift_mm") - inputs[1].value("sideways_drift_mm")) < 1.0
    before, after = inputs[1].array("deformed", "mm"), got.array("deformed", "mm")
    reach = (EDGE - after[:, 1].min()) - (EDGE - before[:, 1].min())
    assert wider_mm - 0.5 < reach < max(wider_mm, 0.0) + 0.5


def test_surface_is_that_of_the_skin_nodes(inputs, tmp_path):
    got = _shaped(inputs, tmp_path, wider_mm=2.0)
    skin = got.array("surface_nodes", "1")
    np.testing.assert_array_equal(skin, MESH.skin_nodes())
    np.testing.assert_array_equal(got.array("surface", "mm"), got.array("deformed", "mm")[skin])


def test_softer_ties_leave_more_of_the_misfit_after_one_round(inputs, tmp_path):
    soft, stiff = (
        _shaped(inputs, tmp_path, {"tie_stiffness": k, "rounds": 1}, wider_mm=2.0).value("outline_after_mean_mm")
        for k in (0.5, 20.0)
    )
    assert soft > 2.0 * stiff


def test_ties_stiffen_with_the_tissue_that_they_draw(inputs, tmp_path):
    """Ties of stiffness 2 draw tissue that has become three times as stiff as ties of 6 draw what is as at first."""
    stiffened = tmp_path / "stiffened.h5"
    shutil.copy(inputs[1].path, stiffened)
    with h5py.File(stiffened, "r+") as file:
        values = file["values"]
        assert json.loads(values["stiffness_ratio"][()]) == 1.0
        del values["stiffness_ratio"]
        values["stiffness_ratio"] = json.dumps(3.0)
    pose = write_pose(tmp_path / "wide.h5", wider_mm=2.0)
    drawn = [
        run("shape", tmp_path / "out", inputs[0] | {"pose": pose, "compress": path}, {"tie_stiffness": k, "rounds": 1})
        for path, k in ((stiffened, 2.0), (inputs[1].path, 6.0), (inputs[1].path, 2.0))
    ]
    one, same, softer = (got.array("deformed", "mm") for got in drawn)
    np.testing.assert_allclose(one, same, atol=1e-9)
    assert np.abs(softer - same).max() > 0.1, "the stiffness must count for this test to say anything"


def test_image_height_does_not_matter(inputs, tmp_path):
    """The pose's height places the result and nothing else."""
    start, lift = inputs[0], 9.0
    height = inputs[1].value("height_mm") + lift
    pose = write_pose(tmp_path / "high.h5", wider_mm=2.0, height_mm=height)
    calibrate = write_start(tmp_path)["calibrate"]
    chain = {"mesh": start["mesh"], "pose": pose}
    compress = run("compress", tmp_path / "out", chain | {"calibrate": calibrate})
    high = run("shape", tmp_path / "out", chain | {"compress": compress.path})
    low = _shaped(inputs, tmp_path, wider_mm=2.0)
    motion = high.array("deformed", "mm") - low.array("deformed", "mm")
    np.testing.assert_allclose(motion, [[0.0, 0.0, lift]] * len(motion), atol=1e-6)


def test_without_an_outline_the_surface_is_the_compressions(inputs, tmp_path):
    got = _shaped(inputs, tmp_path, outlined=False)
    np.testing.assert_array_equal(got.array("deformed", "mm"), inputs[1].array("deformed", "mm"))
    assert got.value("rounds") == 0
    for name in ("penetration_mm", "force_lower_n", "sideways_drift_mm", "folded_corners", "contact_lost"):
        assert got.value(name) == inputs[1].value(name)


def test_failed_compression_is_passed_on(inputs, tmp_path):
    failed = write_failed(tmp_path / "failed.h5", "R", "compress", "CC")
    got = run("shape", tmp_path / "out", inputs[0] | {"compress": failed})
    assert (got.status, got.message) == ("failed", "compress: went wrong")
