"""Stage `pose` on a breast that plates have pressed, whose pose is known."""

import numpy as np
import pytest
from PIL import Image

from mammoreg.errors import NotConvergedError
from mammoreg.fem.plates.closing import Closing
from mammoreg.geometry.frames import plate_rotation
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose import start
from mammoreg.pose.row_order import ORDER_ASSUMED
from mammoreg.pose.thickness import ThicknessEstimate
from stages.engine.artefact import write_artefact
from stages.mesh.record import mesh_fields
from stages.pose.record import PoseRecord
from stages.pose.stage import THICKNESS_AT_BOUND
from tests.stages.pressed_case import ANGLE, EDGE, GAP, MESH, MIDDLE, ROW, pressed, run, write_mammogram, write_start
from tests.stages.synthetic_case import header


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    return write_start(folder) | {"image": write_mammogram(folder / "cc.png")}


@pytest.fixture(scope="module")
def found(inputs, tmp_path_factory):
    return run("pose", tmp_path_factory.mktemp("pose"), inputs, row=ROW)


def test_pose_is_near_the_truth(found):
    assert found.ok, found.message
    assert found.value("angle_deg") == pytest.approx(ANGLE, abs=2.5)
    assert found.value("header_angle_deg") == 0.0
    assert found.value("angle_determined")
    assert found.value("edge_p_mm") == pytest.approx(EDGE, abs=1.5)
    assert found.value("middle_mm") == pytest.approx(MIDDLE, abs=1.0)
    assert found.value("height_mm") == pytest.approx(pressed().view.height_mm, abs=1.0)
    assert found.value("thickness_mm") == GAP
    assert found.value("coarse_rms_mm") < 0.6
    assert 0.1 < PoseRecord(found).outline_step < 1.5


def test_only_what_nobody_gave_is_marked_as_estimated(found):
    assert set(found.value("estimated")) == {"force_n", "source_detector_mm", "support_detector_mm", "polarity"}


def test_methods_without_mechanics_keep_the_volume_and_the_angles_of_their_own(found):
    rigid, scaling = found.array("rigid_matrix", "1"), found.array("scaling_matrix", "1")
    np.testing.assert_allclose(rigid, np.eye(3), atol=1e-12)
    assert found.value("rigid_angle_deg") == 0.0
    stretch = scaling @ plate_rotation(found.value("angle_deg")).T
    share = stretch[2, 2]
    np.testing.assert_allclose(stretch, np.diag([share**-0.5, share**-0.5, share]), atol=1e-9)
    assert share == pytest.approx(GAP / 93.0, rel=0.12), "of the height that the breast has in front of the edge"


def test_left_breast_has_the_same_pose(found, tmp_path):
    left = write_start(tmp_path, "L") | {"image": write_mammogram(tmp_path / "cc.png", "L")}
    other = run("pose", tmp_path / "out", left, row=ROW | {"orientation": "A\\R"}, side="L")
    for name in ("angle_deg", "edge_p_mm", "middle_mm", "height_mm", "rigid_edge_p_mm", "rigid_middle_mm"):
        assert other.value(name) == pytest.approx(found.value(name), abs=1e-6), name


def _picture(path, turned):
    stored = np.asarray(Image.open(write_mammogram(path)))
    Image.fromarray(np.ascontiguousarray(stored[::-1, ::-1] if turned else stored)).save(path)
    return path


@pytest.mark.parametrize("turned", [False, True])
def test_row_order_of_a_picture_without_orientation_is_told_by_its_dense_tissue(inputs, tmp_path, turned):
    row = {name: text for name, text in ROW.items() if name != "orientation"}
    picture = inputs | {"image": _picture(tmp_path / "cc.png", turned)}
    got = run("pose", tmp_path / "out", picture, {"angle_step_deg": 0.0}, row=row)
    assert got.ok, got.message
    assert (got.value("flip_rows"), got.value("flip_columns")) == (turned, not turned)
    assert got.value("middle_mm") == pytest.approx(MIDDLE, abs=1.5)
    assert "orientation" in got.value("estimated")
    assert ORDER_ASSUMED not in got.value("flags")


def test_row_order_that_nothing_tells_is_assumed_as_usual_or_asked_for(inputs, tmp_path):
    row = {name: text for name, text in ROW.items() if name != "orientation"}
    alone = {"angle_step_deg": 0.0, "use_density": False}  # the outline of this breast is the same both ways
    usual = run("pose", tmp_path, inputs, alone, row=row)
    assert usual.ok, usual.message
    assert ORDER_ASSUMED in usual.value("flags")
    assert not usual.value("flip_rows")
    turned = inputs | {"image": _picture(tmp_path / "cc.png", True)}
    other = run("pose", tmp_path / "out", turned, alone, row=row)
    assert other.status == "failed"
    assert all(words in other.message for words in ("column 'orientation'", r"A\L if", r"A\R if"))


def test_missing_thickness_is_estimated_and_marked(inputs, tmp_path):
    row = {name: text for name, text in ROW.items() if name != "thickness_mm"}
    got = run("pose", tmp_path, inputs, {"angle_step_deg": 0.0}, row=row)
    assert got.ok, got.message
    assert "thickness_mm" in got.value("estimated")
    assert got.value("thickness_mm") == pytest.approx(GAP, rel=0.2)
    assert THICKNESS_AT_BOUND not in got.value("flags")


def test_estimated_thickness_at_the_bound_of_its_search_is_flagged(inputs, tmp_path, monkeypatch):
    monkeypatch.setattr(start, "estimate_thickness", lambda *_: ThicknessEstimate(GAP, at_bound=True))
    row = {name: text for name, text in ROW.items() if name != "thickness_mm"}
    got = run("pose", tmp_path, inputs, {"angle_step_deg": 0.0}, row=row)
    assert got.value("thickness_mm") == GAP
    assert THICKNESS_AT_BOUND in got.value("flags")


def test_thickness_larger_than_the_breast_fails_and_says_what_to_do(inputs, tmp_path):
    got = run("pose", tmp_path, inputs, row=ROW | {"thickness_mm": "140"})
    assert got.status == "failed"
    assert "140.0 mm is not below the uncompressed breast's 9" in got.message
    assert "correct thickness_mm" in got.message


@pytest.mark.parametrize("thickness_mm", ["20", "26"])
def test_thickness_too_small_for_the_breast_fails_and_says_what_to_do(inputs, tmp_path, thickness_mm):
    got = run("pose", tmp_path, inputs, row=ROW | {"thickness_mm": thickness_mm})
    assert got.status == "failed"
    assert f"{float(thickness_mm):.1f} mm is too small for a breast of 9" in got.message
    assert "correct thickness_mm in the views table (or the header; it is in mm)" in got.message


def test_unknown_pixel_spacing_fails_and_says_what_to_do(inputs, tmp_path):
    row = {name: text for name, text in ROW.items() if name != "pixel_spacing_mm"}
    got = run("pose", tmp_path, inputs, row=row)
    assert (got.status, "give pixel_spacing_mm" in got.message) == ("failed", True)
    assert str(tmp_path) not in got.message


def test_step_of_zero_keeps_the_headers_angle_and_marks_it(inputs, tmp_path):
    got = run("pose", tmp_path, inputs, {"angle_step_deg": 0.0}, row=ROW | {"angle_deg": "2"})
    assert got.value("angle_deg") == 2.0
    assert not got.value("angle_determined")
    assert "angle not determined by the image" in got.value("flags")


def test_pose_of_a_second_volume_comes_from_its_plates(tmp_path):
    got = run("pose", tmp_path / "out", write_start(tmp_path, compressed=True), view="3D")
    assert got.ok, got.message
    truth = pressed().view
    assert got.value("angle_deg") == pytest.approx(ANGLE, abs=1.0)
    assert got.value("height_mm") == pytest.approx(truth.height_mm, abs=1.0)
    assert got.value("thickness_mm") == pytest.approx(GAP, abs=1.5)
    assert got.value("edge_p_mm") == pytest.approx(EDGE, abs=4.0)
    assert got.value("plates_known")
    assert got.array("outline", "px").shape[1] == 2


def test_case_with_a_compression_alone(tmp_path):
    got = run("pose", tmp_path / "out", write_start(tmp_path), view="3D", row={"compression": "0.3"})
    assert got.ok, got.message
    front = MESH.points[MESH.points[:, 1] < got.value("edge_p_mm"), 2]
    assert got.value("thickness_mm") == pytest.approx(0.7 * np.ptp(front))
    assert got.value("height_mm") + 0.5 * got.value("thickness_mm") == pytest.approx(0.5 * (front.min() + front.max()))
    assert (got.value("angle_deg"), got.value("angle_determined")) == (0.0, False)
    assert np.linalg.det(got.array("scaling_matrix", "1")) == pytest.approx(1.0)
    assert not got.has("outline")


def test_edge_without_an_image_lies_in_front_of_most_but_not_all_of_a_bent_back(tmp_path):
    points, back = MESH.points.copy(), MESH.back_nodes()
    points[:, 1] += 0.4 * (points[:, 2] - points[back, 2].min()) * (1.0 + points[:, 1] / 78.0)
    start = write_start(tmp_path)
    write_artefact(start["mesh"], header("mesh", "R"), mesh_fields(BlockMesh(MESH.n, points), "R", {}))
    got = run("pose", tmp_path / "out", start, view="3D", row={"compression": "0.3"})
    assert got.ok, got.message
    faces = points[MESH.back_quads()]
    area = 0.5 * np.linalg.norm(np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1]), axis=1)
    behind = area[faces[..., 1].mean(axis=1) > got.value("edge_p_mm")].sum() / area.sum()
    assert 0.6 < behind < 0.9


def test_case_with_nothing_to_go_by_fails(tmp_path):
    got = run("pose", tmp_path / "out", write_start(tmp_path), view="3D")
    assert (got.status, "neither a mammogram" in got.message) == ("failed", True)


def test_a_thickness_in_centimetres_fails_and_says_so(inputs, tmp_path):
    got = run("pose", tmp_path, inputs, row=ROW | {"thickness_mm": "5.8"})
    assert got.status == "failed"
    assert "thickness_mm 5.8 is impossible (10 to 160 mm)" in got.message


def test_the_size_of_image_and_model_is_compared(found):
    assert found.value("relative_size") == pytest.approx(1.0, abs=0.03)
    assert found.value("imaged_ml") > 0.0
    assert not any("size" in flag or "smaller" in flag or "larger" in flag for flag in found.value("flags"))


def test_a_pixel_spacing_that_cannot_be_fails_with_numbers(inputs, tmp_path):
    row = ROW | {"pixel_spacing_mm": str(0.3 * float(ROW["pixel_spacing_mm"]))}
    got = run("pose", tmp_path, inputs, row=row)
    assert got.status == "failed"
    assert "the mammogram shows" in got.message
    assert "they are not of one size; check pixel spacing, thickness, magnification" in got.message


def test_nothing_converges(inputs, tmp_path, monkeypatch):
    def never(self, gap_mm):
        raise NotConvergedError("no")

    monkeypatch.setattr(Closing, "close", never)
    got = run("pose", tmp_path, inputs, row=ROW)
    assert (got.status, "at none of the angles" in got.message) == ("not_converged", True)
