"""A volunteer's landmarks under materials, boundary conditions and skins, on a breast whose compression is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mammoreg.geometry import plate_to_breast
from mammoreg.localization.deformation import MeshDeformation, ReferenceMesh
from mammoreg.materials.tissue import MATERIALS
from mammoreg.meshing.skin import skin_facets
from mammoreg.shape.surface_points import nearest_on_skin
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from stages.studies import chain
from tests.stages.pressed_case import ANGLE, MESH, pressed, run, write_pose, write_start
from tests.stages.synthetic_case import write_failed

LANDMARKS = np.array([[12.0, -30.0, 18.0], [-15.0, -40.0, -16.0], [3.0, -58.0, 5.0], [25.0, -24.0, -6.0]])
SKIN = skin_facets(MESH.skin_quads(), len(MESH.points), 2).positions(MESH.points)[4::40]
SKIN = SKIN[SKIN[:, 1] < -10.0]


def write_points(folder: Path, name: str, points: np.ndarray) -> Path:
    path = folder / f"{name}.tsv"
    lines = [f"P{n}\t" + "\t".join(f"{x:.4f}" for x in point) for n, point in enumerate(points)]
    path.write_text("name\tx\ty\tz\n" + "\n".join(lines) + "\n")
    return path


def truly_pressed(points: np.ndarray) -> np.ndarray:
    """Points of the undeformed breast between the plates, breast frame, which is LPS for a right breast."""
    carried = MeshDeformation(ReferenceMesh(MESH.points, MESH.hexes()), pressed().nodes).forward(points)
    return plate_to_breast(carried, ANGLE)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The main run of a volunteer, and its points in both volumes."""
    folder = tmp_path_factory.mktemp("volunteer")
    found = write_start(folder, compressed=True)
    found["pose"] = run("pose", folder, found, view="3D").path.rename(folder / "pose.3D.h5")
    given = {
        "compress": ("mesh", "pose", "calibrate"),
        "shape": ("mesh", "pose", "compress"),
        "solve": ("mesh", "compress", "shape"),
    }
    for stage, names in given.items():
        path = run(stage, folder, {name: found[name] for name in names}, view="3D").path
        found[stage] = path.rename(folder / f"{stage}.3D.h5")
    del found["shape"]
    found["mr_landmarks"] = write_points(folder, "before", LANDMARKS)
    found["mr_compressed_landmarks"] = write_points(folder, "after", truly_pressed(LANDMARKS))
    # One more point lies far off, as on skin that a mesh does not reach.
    found["mr_surface_points"] = write_points(folder, "skin", np.vstack([SKIN, [0.0, 20.0, 90.0]]))
    found["mr_compressed_surface_points"] = write_points(
        folder, "pressed_skin", np.vstack([truly_pressed(SKIN), [30.0, 20.0, 40.0]])
    )
    return found


def study(folder: Path, inputs: dict[str, Path], settings: dict[str, Any] | None = None) -> Artefact:
    folder.mkdir(exist_ok=True)
    run_stage("volunteer", inputs, folder / "volunteer.h5", settings or {}, Subject("case1", "R"))
    return Artefact(folder / "volunteer.h5")


@pytest.fixture(scope="module")
def studied(inputs: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Artefact:
    return study(tmp_path_factory.mktemp("study"), inputs, {"fibre_ratio": 1.0})


def distances(artefact: Artefact, table: str, key: str, name: str) -> list[float]:
    return [row["distance_mm"] for row in artefact.value(f"{table}_rows") if row[key] == name]


def test_before_is_the_motion_and_translation_the_best_of_its_kind(studied: Artefact) -> None:
    motion = truly_pressed(LANDMARKS) - LANDMARKS
    np.testing.assert_allclose(
        distances(studied, "table_3", "boundary", "before"), np.linalg.norm(motion, axis=1), atol=1e-3
    )
    rest = np.linalg.norm(motion - motion.mean(axis=0), axis=1)
    np.testing.assert_allclose(distances(studied, "table_3", "boundary", "translation"), rest, atol=1e-3)


def test_the_tissue_of_the_truth_finds_the_landmarks(studied: Artefact) -> None:
    plate = np.array(distances(studied, "table_3", "boundary", "plate"))
    assert plate.mean() < 1.0
    assert plate.mean() < 0.3 * np.mean(distances(studied, "table_3", "boundary", "before"))


def test_every_variation_has_a_row_for_each_landmark(studied: Artefact) -> None:
    names = {"table_2": ("model", MATERIALS), "table_3": ("boundary", ("plate", "additional_points", "updated"))}
    names["table_4"] = ("skin", ("none", "attached", "sliding", "adherent"))
    for table, (key, variations) in names.items():
        rows = studied.value(f"{table}_rows")
        assert list(dict.fromkeys(row[key] for row in rows)) == ["before", "translation", *variations]
        assert len(rows) == len(LANDMARKS) * (2 + len(variations))
        assert all(0.0 <= row["lateral_mm"] <= row["distance_mm"] < 15.0 for row in rows)


def test_what_no_table_varies_is_the_main_run(studied: Artefact) -> None:
    plate = distances(studied, "table_3", "boundary", "plate")
    assert distances(studied, "table_2", "model", "homogeneous") == plate
    without_skin = distances(studied, "table_4", "skin", "none")
    assert without_skin != plate
    np.testing.assert_allclose(without_skin, plate, atol=1.0)  # smooth plates alone
    moved = {(run["table"], run["name"]): run["moved_mm"] for run in studied.value("runs")}
    assert moved["table_2", "homogeneous"] == moved["table_3", "plate"] == moved["table_4", "none"] == 0.0
    assert moved["table_2", "lorenzen"] > 0.05
    assert moved["table_4", "attached"] > 0.01


def test_without_fibres_the_breast_goes_forward(inputs: dict[str, Path], studied: Artefact, tmp_path: Path) -> None:
    few = {name: path for name, path in inputs.items() if "surface" not in name}
    plain = study(tmp_path, few)
    with_fibres, without = (_run_of(a, "table_4", "none")["antero_posterior_mm"] for a in (studied, plain))
    assert without > with_fibres + 0.1
    assert plain.value("mechanics")["plain"]["fibre_ratio"] == 0.0
    assert plain.value("mechanics")["own"]["fibre_ratio"] == 1.0
    assert distances(plain, "table_3", "boundary", "additional_points") == [None] * len(LANDMARKS)
    assert "no mr_surface_points" in _run_of(plain, "table_3", "additional_points")["message"]


def _run_of(artefact: Artefact, table: str, name: str) -> dict[str, Any]:
    return next(r for r in artefact.value("runs") if (r["table"], r["name"]) == (table, name))


def test_known_points_draw_the_skin_and_the_landmarks(inputs: dict[str, Path], studied: Artefact) -> None:
    drawn = _run_of(studied, "table_3", "additional_points")
    assert drawn["points"] == len(SKIN)
    assert drawn["points_left_mm"] < 0.3
    assert 0.0 < drawn["moved_mm"] < 1.5
    found = np.mean(distances(studied, "table_3", "boundary", "additional_points"))
    assert found < np.mean(distances(studied, "table_3", "boundary", "plate")) + 0.1


def test_a_solve_that_fails_is_a_row_with_its_reason(
    inputs: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(name: str, given: Any, output: Path, settings: Any, subject: Subject) -> Fields:
        if settings["mechanics"]["material"] == "azar":
            given = given | {"pose": [write_pose(tmp_path / "wide.h5", view="3D", thickness_mm=150.0)]}
        return run_stage(name, given, output, settings, subject)

    monkeypatch.setattr(chain, "run_stage", failing)
    got = study(tmp_path, inputs)
    assert got.ok
    assert distances(got, "table_2", "model", "azar") == [None] * len(LANDMARKS)
    assert "150.0 mm does not compress" in _run_of(got, "table_2", "azar")["message"]
    assert None not in distances(got, "table_2", "model", "wellman")


def test_a_case_without_landmarks_in_both_volumes_has_no_rows(inputs: dict[str, Path], tmp_path: Path) -> None:
    got = study(tmp_path, {n: p for n, p in inputs.items() if n in ("segment", "mesh", "pose", "mr_landmarks")})
    assert [got.value(f"table_{n}_rows") for n in (2, 3, 4)] == [[], [], []]


def test_a_failed_pose_is_named_in_every_row(inputs: dict[str, Path], tmp_path: Path) -> None:
    pose = Artefact(write_failed(tmp_path / "pose.3D.h5", "R", "pose", "3D"))
    got = study(tmp_path, inputs | {"pose": pose.path})
    assert distances(got, "table_4", "skin", "none") == [None] * len(LANDMARKS)
    assert distances(got, "table_4", "skin", "before")[0] > 1.0
    assert {run["message"] for run in got.value("runs")} == {pose.message}


def test_nearest_point_of_the_skin() -> None:
    corners, shares = nearest_on_skin(MESH.points, MESH.skin_quads(), SKIN)
    np.testing.assert_allclose(np.einsum("pa,pai->pi", shares, MESH.points[corners]), SKIN, atol=1e-9)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    off = SKIN + np.array([0.0, 0.0, 0.4])
    corners, shares = nearest_on_skin(MESH.points, MESH.skin_quads(), off)
    found = np.einsum("pa,pai->pi", shares, MESH.points[corners])
    assert np.linalg.norm(found - off, axis=1).max() <= 0.4 + 1e-9
