"""A user of the library and a user of the workflow get the same places from the same breast and mammogram."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import mammoreg
from mammoreg.geometry import lps_to_breast
from mammoreg.localization.deformation import MeshDeformation, MethodView, ReferenceMesh
from stages.pose.record import PoseRecord
from tests.stages import pressed_case as case

POINTS = np.array([[10.0, -30.0, 12.0], [-20.0, -45.0, -8.0], [0.0, -60.0, 5.0]])


@pytest.fixture(scope="module", params=["R", "L"])
def both(request, tmp_path_factory: pytest.TempPathFactory) -> tuple[MethodView, mammoreg.RegisteredView]:
    """Method `updated` by the stages, and the library's view."""
    side, folder = request.param, tmp_path_factory.mktemp("same")
    inputs = case.write_start(folder, side) | {"image": case.write_mammogram(folder / "cc.png", side)}
    row = case.ROW | ({"orientation": "A\\R"} if side == "L" else {})
    for stage, needed in (
        ("pose", ("segment", "mesh", "calibrate", "image")),
        ("compress", ("mesh", "pose", "calibrate")),
        ("shape", ("mesh", "pose", "compress")),
        ("solve", ("mesh", "compress", "shape")),
    ):
        found = case.run(stage, folder, {name: inputs[name] for name in needed}, row=row, side=side)
        inputs[stage] = Path(found.path)
    stages = _stages_view(inputs, found.array("deformed", "mm"))
    labels = case.labels()
    mask, nipple = labels.with_data((labels.data > 0).astype(np.uint8)), np.array([0.0, -78.0, 0.0])
    breast = mammoreg.Breast(side, labels, mask, nipple, case.MESH)
    pixels = case.canonical_pixels()[:, ::-1] if side == "R" else case.canonical_pixels()
    image = mammoreg.Mammogram(
        pixels, "CC", case.PIXEL_MM, thickness_mm=case.GAP, angle_deg=0.0, orientation=row["orientation"]
    )
    mechanics = mammoreg.BreastMechanics(material="homogeneous")
    return stages, mammoreg.register(breast, image, mechanics, mu_kpa=case.MU)


def _stages_view(inputs: dict[str, Path], deformed: np.ndarray) -> MethodView:
    pose = case.Artefact(inputs["pose"])
    return MethodView(
        MeshDeformation(ReferenceMesh(case.MESH.points, case.MESH.hexes()), deformed), PoseRecord(pose).geometry
    )


def test_pose_is_the_same(both):
    stages, library = both
    for name, value in asdict(stages.geometry).items():
        assert getattr(library.geometry, name) == pytest.approx(value, abs=1e-6), name


def test_deformed_breast_is_the_same(both):
    stages, library = both
    np.testing.assert_allclose(library.method.deformation.deformed, stages.deformation.deformed, atol=1e-4)


def test_points_land_on_the_same_pixels(both):
    stages, library = both
    side = library.breast.laterality
    shown = library.to_mammogram(lps_to_breast(POINTS, side))
    expected = stages.project(POINTS)
    if side == "R":
        expected[:, 0] = case.COLUMNS - 1 - expected[:, 0]
    np.testing.assert_allclose(shown, expected, atol=0.01)
