"""Stage `compress`: what its settings do, and what it leaves for later stages."""

import numpy as np
import pytest

from mammoreg.fem.parts.plane_ties import PlaneTies
from mammoreg.geometry import breast_to_plate
from mammoreg.meshing.locate import Locator
from stages.compress import gland_map
from stages.compress.record import CompressRecord
from stages.engine.artefact import Artefact, write_artefact
from stages.engine.contract import Inputs
from stages.segment.record import SegmentRecord, segment_fields
from tests.stages.pressed_case import ANGLE, EDGE, GAP, MESH, MU, pressed, run, write_pose, write_start
from tests.stages.synthetic_case import header


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    start = write_start(folder)
    return {"mesh": start["mesh"], "calibrate": start["calibrate"], "pose": write_pose(folder / "pose.h5")}


@pytest.fixture(scope="module")
def plain(inputs, tmp_path_factory):
    return run("compress", tmp_path_factory.mktemp("compress"), inputs)


@pytest.fixture(scope="module")
def segment(tmp_path_factory):
    return write_start(tmp_path_factory.mktemp("segment"))["segment"]


def _with(inputs, folder, **mechanics):
    got = run("compress", folder, inputs, {"mechanics": mechanics})
    assert got.ok, got.message
    return got


def _nodes(artefact):
    return artefact.array("deformed", "mm")


def _reach(artefact):
    """How far the breast comes forward between the plates, mm."""
    return float(EDGE - _nodes(artefact)[:, 1].min())


def test_breast_lies_between_the_plates_and_keeps_its_volume(plain):
    assert plain.ok, plain.message
    np.testing.assert_allclose(_nodes(plain), pressed().nodes, atol=0.01)
    front = _nodes(plain)[_nodes(plain)[:, 1] < EDGE - 8.0]
    heights = front[:, 2] - plain.value("height_mm")
    assert heights.min() > -0.5
    assert heights.max() < GAP + 0.5
    assert abs(plain.value("volume_change")) < 0.01
    assert plain.value("min_det_f") > 0.3
    assert plain.value("force_lower_n") == pytest.approx(plain.value("force_upper_n"), rel=1e-3)
    assert plain.value("uncompressed_mm") > GAP


def test_plates_lie_where_the_pose_has_seen_them(inputs, plain, tmp_path):
    height = pressed().view.height_mm
    moved = run("compress", tmp_path, inputs | {"pose": write_pose(tmp_path / "p.h5", height_mm=height + 7.0)})
    np.testing.assert_allclose(_nodes(moved) - _nodes(plain), np.tile([0.0, 0.0, 7.0], (len(MESH.points), 1)))
    assert moved.value("lift_mm") == pytest.approx(plain.value("lift_mm") + 7.0)


def test_known_plates_are_not_floated(inputs, plain, tmp_path):
    height = pressed().view.height_mm
    pose = write_pose(tmp_path / "p.h5", height_mm=height + 6.0, plates_known=True)
    known = run("compress", tmp_path, inputs | {"pose": pose})
    assert known.value("lift_mm") == pytest.approx(0.0, abs=1e-9)
    back = MESH.back_nodes()
    shift = (_nodes(known) - _nodes(plain))[:, 2]
    assert shift[_nodes(plain)[:, 1] < EDGE - 8.0].mean() == pytest.approx(6.0, abs=0.2)
    assert shift[back].mean() < 5.0, "the tissue behind holds the back where it was"
    assert known.value("force_lower_n") != pytest.approx(known.value("force_upper_n"), rel=0.02)


def test_fixed_back_stays_and_costs_force(inputs, plain, tmp_path):
    fixed = _with(inputs, tmp_path, back="fixed")
    free = _with(inputs, tmp_path, back="slide_plane")
    back = MESH.back_nodes()
    motion = {name: np.abs(_nodes(a) - _nodes(fixed))[back].max() for name, a in (("plain", plain), ("free", free))}
    assert motion["plain"] > 0.5
    assert fixed.value("force_n") > plain.value("force_n") > free.value("force_n")


@pytest.mark.parametrize("layer_mm", [15.0, 60.0])
def test_back_slides_against_the_shear_of_the_layer_behind_it(inputs, tmp_path, layer_mm):
    """A layer of the tissue's own shear modulus, sheared by the back's motion, holds mu |u|^2 / 2 L on each area."""
    got = _with(inputs, tmp_path, back_layer_mm=layer_mm)
    lift = [0.0, 0.0, got.value("lift_mm")]
    motion = (_nodes(got) - lift - breast_to_plate(MESH.points, ANGLE))[MESH.back_quads()]
    np.testing.assert_allclose(motion[..., 1], 0.0, atol=0.01, err_msg="the back of this breast is a plane")
    faces = MESH.points[MESH.back_quads()]
    area = 0.5 * np.linalg.norm(np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1]), axis=1)
    sheared = (motion**2).sum(axis=-1).mean(axis=1)
    assert sheared.max() > 1.0, "the back must slide for this test to say anything"
    energy = 0.5 * MU / layer_mm * float(area @ sheared)  # kPa mm3 = uJ; the report has mJ
    assert got.value("part_energies_mj")["BackSprings"] == pytest.approx(1e-3 * energy, rel=0.02)


def test_plates_without_end_press_harder(inputs, plain, tmp_path):
    endless = _with(inputs, tmp_path, plates_end=False)
    assert endless.value("force_n") > 1.1 * plain.value("force_n")
    behind = _nodes(plain)[:, 1] > EDGE
    assert np.ptp(_nodes(endless)[behind, 2]) < np.ptp(_nodes(plain)[behind, 2]) - 5.0


def test_friction_holds_the_skin_back(inputs, tmp_path):
    slippery, rough = (_with(inputs, tmp_path, friction=mu) for mu in (0.0, 0.9))
    height = _nodes(rough)[:, 2] - rough.value("height_mm")
    held = ((height < 1.0) | (height > GAP - 1.0)) & (_nodes(rough)[:, 1] < EDGE - 8.0)
    motion = {
        a: np.linalg.norm((_nodes(a) - breast_to_plate(MESH.points, ANGLE))[held, :2], axis=1)
        for a in (slippery, rough)
    }
    assert held.sum() >= 5
    assert motion[rough].mean() < 0.9 * motion[slippery].mean()
    assert rough.value("force_n") > slippery.value("force_n")
    assert [f"contact/{name}" in rough.names() for name in ("anchor", "traction", "pressure")] == [True] * 3
    assert not [name for name in slippery.names() if name.startswith("contact/")], "no friction, no memory of it"


def test_fibres_along_the_nipple_axis_shorten_the_reach(inputs, tmp_path):
    plain, stiff = (_with(inputs, tmp_path, fibre_ratio=ratio) for ratio in (0.0, 5.0))
    assert _reach(stiff) < _reach(plain) - 0.5
    width = {a: np.ptp(_nodes(a)[:, 0]) for a in (plain, stiff)}
    assert width[stiff] > width[plain], "the tissue goes sideways instead"


@pytest.mark.parametrize(("layer", "acts_mm"), [("measured", 15.0), ("constant", 60.0)])
def test_layer_behind_the_back_is_the_patient_s_own_where_it_was_measured(inputs, tmp_path, layer, acts_mm):
    fields = segment_fields({}, MESH.points, MESH.points[0], "R", {"back_layer_mm": 15.0})
    write_artefact(tmp_path / "measured.h5", header("segment", "R"), fields)
    told = inputs | {"segment": tmp_path / "measured.h5"}
    got = _with(told, tmp_path, back_layer=layer, back_layer_mm=60.0)
    alike = _with(inputs, tmp_path, back_layer_mm=acts_mm)
    np.testing.assert_array_equal(_nodes(got), _nodes(alike))
    assert CompressRecord(got).mechanics.back_layer_mm == acts_mm


def test_stiffer_gland_keeps_the_mean_stiffness_but_moves_the_nodes(inputs, segment, plain, tmp_path):
    contrasted = _with(inputs | {"segment": segment}, tmp_path, material="fat_and_gland", gland_contrast=6.0)
    assert contrasted.value("force_n") == pytest.approx(plain.value("force_n"), rel=0.35)
    assert np.abs(_nodes(contrasted) - _nodes(plain)).max() > 0.2


def test_tissue_map_is_made_where_a_material_asks_for_it(inputs, segment, plain, tmp_path, monkeypatch):
    told = inputs | {"segment": segment}
    with monkeypatch.context() as patch:
        patch.setattr(gland_map, "gland_fraction", lambda *_: pytest.fail("made for homogeneous tissue"))
        alike = run("compress", tmp_path, told)
    np.testing.assert_array_equal(_nodes(alike), _nodes(plain))
    assert "gland_fraction" not in alike.names()
    share = _with(told, tmp_path, material="fat_and_gland", gland_contrast=2.0).array("gland_fraction", "1")
    assert len(share) == len(MESH.hexes())
    assert share.min() == 0.0
    assert share.max() > 0.3
    without = run("compress", tmp_path, inputs, {"mechanics": {"material": "fat_and_gland"}})
    assert without.status == "failed"
    assert "needs the input segment; give it with --in segment=path" in without.message


def test_skin_counts_as_tissue_that_is_not_gland(segment, inputs, tmp_path):
    labels = SegmentRecord(Artefact(segment)).labels
    coded = labels.with_data(np.where(labels.data == 1, 3, labels.data).astype(np.uint8))  # all but the gland is skin
    skinned = tmp_path / "skin.h5"
    write_artefact(
        skinned, header("segment", "R"), segment_fields({"labels": coded}, MESH.points, MESH.points[0], "R", {})
    )
    artefacts = {"segment": [Artefact(skinned)], "mesh": [Artefact(inputs["mesh"])]}
    found = gland_map.gland_share(Inputs(stages=artefacts))
    inside = np.argwhere(coded.data > 0)
    element, _, kept = Locator(MESH.points, MESH.hexes()).locate(coded.to_world(inside))
    gland = (coded.data[tuple(inside.T)] == 2)[kept]
    counts = np.bincount(element[kept], minlength=len(found))
    share = np.bincount(element[kept], weights=gland, minlength=len(found)) / counts
    assert 0.2 < share.max() < 0.8
    np.testing.assert_allclose(found, share, atol=0.04)


@pytest.mark.parametrize("material", ["wellman", "bakic"])
def test_the_paper_s_tissues_are_pressed_with_the_same_plates(inputs, segment, plain, tmp_path, material):
    got = _with(inputs | {"segment": segment}, tmp_path, material=material, fibre_ratio=0.0)
    assert got.value("thickness_mm") == plain.value("thickness_mm")
    assert abs(got.value("volume_change")) < 0.01
    assert got.value("min_det_f") > 0.2
    assert 0.2 < got.value("compression") < 0.6
    stiffer = {"wellman": got.value("stiffness_ratio") > 2.0, "bakic": 0.9 < got.value("stiffness_ratio") < 1.1}
    assert stiffer[material]
    heights = _nodes(got)[_nodes(got)[:, 1] < EDGE - 8.0, 2] - got.value("height_mm")
    assert heights.min() > -1.0
    assert heights.max() < GAP + 1.0


def test_force_scales_with_the_stiffness(inputs, plain, tmp_path):
    soft = write_start(tmp_path, mu_kpa=4.7)["calibrate"]
    got = run("compress", tmp_path / "out", inputs | {"calibrate": soft})
    assert got.value("force_n") == pytest.approx(0.5 * plain.value("force_n"), rel=0.01)
    assert np.abs(_nodes(got) - _nodes(plain)).max() < 0.05


def test_resumed_closing_is_what_compress_left(inputs, plain):
    record = CompressRecord(plain)
    closing, closed = record.resumed(MESH)
    np.testing.assert_allclose(record.frame.to_plate(closed.deformed), _nodes(plain), atol=1e-12)
    idle = _idle()
    again = closing.rest(closed, idle, 0.05)
    assert np.abs(again.deformed - closed.deformed).max() < 0.15
    assert again.force_n == pytest.approx(closed.force_n, rel=0.02)
    assert again.energy_mj == pytest.approx(closed.energy_mj, rel=0.01)


def test_gap_wider_than_the_breast_is_named(inputs, tmp_path):
    got = run("compress", tmp_path, inputs | {"pose": write_pose(tmp_path / "p.h5", thickness_mm=150.0)})
    assert got.status == "not_converged"
    assert "150.0 mm does not compress a breast of" in got.message


def test_case_with_a_compression_alone_is_pressed(tmp_path):
    start = write_start(tmp_path)
    pose = tmp_path / "out" / "pose.3D.0.h5"
    assert run("pose", tmp_path / "out", start, view="3D", row={"compression": "0.25"}).ok
    chain = {"mesh": start["mesh"], "calibrate": start["calibrate"], "pose": pose}
    got = run("compress", tmp_path / "out", chain, view="3D")
    assert got.ok, got.message
    assert got.value("thickness_mm") < 0.8 * np.ptp(MESH.points[:, 2])


def test_facts_of_the_deformed_mesh_stand_beside_the_forces(plain):
    forces = [plain.value(f"force_{plate}_n") for plate in ("lower", "upper")]
    assert plain.value("force_n") == pytest.approx(np.mean(forces))
    assert not plain.value("contact_lost")
    assert abs(plain.value("sideways_drift_mm")) < 2.0
    assert len(plain.value("folded_corner_points")) == plain.value("folded_corners")


def test_report_of_the_solve_is_kept_without_its_times(inputs, plain, tmp_path):
    assert plain.value("unbalance") < 0.02
    assert plain.value("energy_mj") > 10.0 * plain.value("volumetric_energy_mj") > 0.0
    assert set(plain.value("part_energies_mj")) == {"BackSprings"}
    assert plain.value("iterations") == len(plain.array("residuals", "1"))
    assert not [name for name in plain.value_names() if "second" in name or "wall" in name]
    assert run("compress", tmp_path, inputs).path.read_bytes() == plain.path.read_bytes()


def test_plates_stop_at_the_header_s_force(inputs, plain, tmp_path):
    pose = write_pose(tmp_path / "p.h5", header_force_n=0.5 * plain.value("force_n"))
    got = run("compress", tmp_path / "out", inputs | {"pose": pose}, {"stop": "force"})
    assert got.ok, got.message
    assert got.value("force_n") == pytest.approx(0.5 * plain.value("force_n"), rel=0.01)
    assert plain.value("thickness_mm") + 2.0 < got.value("thickness_mm") < got.value("uncompressed_mm")
    unknown = run("compress", tmp_path / "out", inputs, {"stop": "force"})
    assert unknown.status == "failed"
    assert "give force_n in the views table, or set compress.stop to thickness" in unknown.message


def test_skin_sticks_where_friction_has_no_limit(inputs, plain, tmp_path):
    stuck = _with(inputs, tmp_path, friction=float("inf"))
    assert stuck.value("mechanics")["friction"] == "Infinity"
    assert stuck.value("force_n") > plain.value("force_n")
    closing, closed = CompressRecord(stuck).resumed(MESH)
    assert closing.contact.sticks
    assert closed.force_n[0] == stuck.value("force_lower_n")


def test_one_plate_moves(inputs, plain, tmp_path):
    """The lower plate stays where it has first touched; the back's springs bear the difference of the forces."""
    upper = _with(inputs, tmp_path, moving="upper")
    assert upper.value("thickness_mm") == plain.value("thickness_mm")
    assert upper.value("force_lower_n") != pytest.approx(upper.value("force_upper_n"), rel=0.02)
    back = [breast_to_plate(MESH.points, ANGLE)[MESH.back_nodes(), 2], _nodes(upper)[MESH.back_nodes(), 2]]
    sunk = np.mean(back[1] - upper.value("lift_mm") - back[0])
    assert sunk < -1.0, "the middle between the plates goes down"


def test_standing_up_lets_the_breast_fall_back_and_down(inputs, plain, tmp_path):
    heavy = _with(inputs, tmp_path, gravity="standing")
    assert set(heavy.value("part_energies_mj")) == {"BackSprings", "Gravity"}
    moved = _nodes(heavy) - _nodes(plain)
    assert moved[:, 1].mean() > 0.1, "what hung forwards comes back"
    light = _with(inputs, tmp_path, gravity="standing", density_kg_m3=100.0)
    less = _nodes(light) - _nodes(plain)
    assert less[:, 1].mean() == pytest.approx(0.1 * moved[:, 1].mean(), rel=0.5)


@pytest.mark.parametrize("skin", ["attached", "sliding", "adherent"])
def test_skin_holds_the_breast_together(inputs, plain, tmp_path, skin):
    """Stiff skin needs more force; `resumed` knows it again."""
    tight = _with(inputs, tmp_path, skin=skin, skin_modulus_kpa=100.0)
    # No friction passes through a sliding skin: it is compared between smooth plates.
    bare = _with(inputs, tmp_path, friction=0.0) if skin == "sliding" else plain
    assert tight.value("force_n") > 1.02 * bare.value("force_n")
    assert tight.value("part_energies_mj")["Membrane"] > 0.0
    assert ("membrane" in tight.names()) is (skin != "attached")
    closing, closed = CompressRecord(tight).resumed(MESH)
    np.testing.assert_allclose(closed.deformed[:, 2] + tight.value("lift_mm"), _nodes(tight)[:, 2], atol=1e-9)
    again = closing.rest(closed, _idle(), 0.05)
    assert np.abs(again.deformed - closed.deformed).max() < 0.3
    assert again.force_n == pytest.approx(closed.force_n, rel=0.03)


def _idle():
    """A tie without stiffness."""
    return PlaneTies(MESH.skin_quads()[:1], np.full((1, 4), 0.25), np.eye(3)[:1], np.zeros(1), np.zeros(1))
