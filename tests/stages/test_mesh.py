"""Stage `mesh`: its artefact, both sides, warnings, failures, and the required quality on the shared cases."""

import csv

import numpy as np
import pytest

from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.trilinear import volumes
from stages.compress.gland_map import gland_share
from stages.engine.artefact import Artefact, write_artefact
from stages.engine.contract import Inputs, Subject
from stages.engine.run import run_stage
from stages.segment.record import segment_fields
from tests.shared_data import DATA, requires_shared
from tests.unit.breast_bodies import half_ellipsoid


def write_segment(path, laterality, points=None):
    mask, back, nipple = half_ellipsoid()
    labels = mask.data.copy()
    labels[mask.to_world(np.indices(mask.shape).transpose(1, 2, 3, 0))[..., 2] > 0] *= 2
    volumes = {"breast_mask": mask, "labels": mask.with_data(labels)}
    fields = segment_fields(volumes, back if points is None else points, nipple, laterality, {})
    header = {"stage": "segment", "case": "c", "view": "", "laterality": laterality, "artefact_id": "s", "status": "ok"}
    write_artefact(path, header, fields)
    return path


def run_mesh(folder, laterality, settings, **given):
    segment = write_segment(folder / f"segment{laterality}.h5", laterality, **given)
    output = folder / f"mesh{laterality}.h5"
    run_stage("mesh", {"segment": [segment]}, output, settings, Subject("c", laterality))
    return Artefact(output)


def _gland_share(folder, side):
    """The tissue map of the mesh that `run_mesh` has left."""
    artefacts = {name: [Artefact(folder / f"{name}{side}.h5")] for name in ("segment", "mesh")}
    return gland_share(Inputs(stages=artefacts))


def test_both_sides_give_mirrored_right_handed_meshes(tmp_path):
    right, left = (run_mesh(tmp_path, side, {"elements": 5}) for side in ("R", "L"))
    points = {side: mesh.array("points", "mm") for side, mesh in (("R", right), ("L", left))}
    np.testing.assert_allclose(points["L"] * [-1.0, 1.0, 1.0], points["R"], atol=1e-6)
    for mesh in (right, left):
        hexes = mesh.array("hexes", "1")
        assert (volumes(mesh.array("points", "mm")[hexes]) > 0).all()
    shares = [_gland_share(tmp_path, side) for side in ("L", "R")]
    np.testing.assert_allclose(*shares, atol=1e-9)


def test_gland_fills_the_upper_half(tmp_path):
    mesh = run_mesh(tmp_path, "R", {"elements": 5})
    block = BlockMesh(int(mesh.value("n")), mesh.array("points", "mm"))
    middle = block.points[block.hexes()].mean(axis=1)[:, 2]
    gland = _gland_share(tmp_path, "R")
    assert (gland[middle > 12.0] > 0.99).all()
    assert (gland[middle < -12.0] < 0.01).all()
    assert mesh.value("warnings") == []
    assert mesh.value("min_gauss_jacobian") > 0.2


def test_what_misses_the_required_quality_is_recorded(tmp_path):
    mesh = run_mesh(tmp_path, "R", {"elements": 3, "max_volume_error": 1e-6, "max_distance_mean_mm": 0.01})
    assert mesh.status == "ok"
    assert len(mesh.value("warnings")) == 2
    assert "volume differs" in mesh.value("warnings")[0]


def test_a_chest_wall_off_the_mask_ends_as_a_failed_artefact(tmp_path):
    _, back, _ = half_ellipsoid()
    mesh = run_mesh(tmp_path, "R", {}, points=back + np.array([0.0, 50.0, 0.0]))
    assert mesh.status == "failed"
    assert "chest-wall surface" in mesh.message


def shared_cases():
    for folder in ("twins", "victre"):
        table = DATA / folder / "cases.tsv"
        lines = table.read_text().splitlines() if table.exists() else ["case", folder]
        rows = list(csv.DictReader(lines, delimiter="\t"))
        for row in rows:
            yield pytest.param(folder, row, id=row["case"], marks=requires_shared(folder))


@pytest.mark.parametrize(("folder", "row"), list(shared_cases()))
def test_required_quality_on_real_anatomy(tmp_path, folder, row):
    files = {name: DATA / folder / row[name] for name in ("mr", "mr_labels") if row.get(name)}
    subject = Subject(row["case"], row["laterality"])
    run_stage("segment", files, tmp_path / "segment.h5", {}, subject)
    run_stage("mesh", {"segment": [tmp_path / "segment.h5"]}, tmp_path / "mesh.h5", {"elements": 7}, subject)
    mesh = Artefact(tmp_path / "mesh.h5")
    assert (mesh.status, mesh.value("warnings")) == ("ok", [])
    assert mesh.value("min_gauss_jacobian") > 0.2
    assert mesh.value("min_corner_jacobian") > 0.0
    assert abs(mesh.value("volume_error")) < 0.02
    assert mesh.value("surface_distance_mean_mm") < 1.0
    assert mesh.value("surface_distance_p95_mm") < 3.0
