"""Stage `project` on a synthetic breast whose compression is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mammoreg.geometry import Volume
from mammoreg.materials.attenuation import ATTENUATION_20KEV_PER_MM
from mammoreg.projection.cone_beam import project_volume
from stages.engine.artefact import Artefact, write_artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from stages.pose.record import PoseFields, PoseRecord
from stages.segment.record import SegmentRecord, segment_fields
from tests.stages.synthetic_case import (
    COLUMNS,
    DEPTH,
    HALF_WIDTH,
    PIXEL_MM,
    ROWS,
    compression,
    geometry,
    header,
    write_case,
    write_failed,
)
from tests.stages.xarray_volumes import check_volumes

GLAND = np.array([12.0, -30.0, 8.0])
STEP = 3


def _segment(path: Path, laterality):
    """Replace the segmentation by one with labels (fat around a ball of gland) and an MR volume."""
    old = SegmentRecord(Artefact(path))
    mask = old.breast_mask
    where = np.stack(np.meshgrid(*(np.arange(size) for size in mask.shape), indexing="ij"), axis=-1)
    gland = np.linalg.norm(mask.to_world(where) - GLAND, axis=-1) < 9.0
    labels = mask.with_data((mask.data * np.where(gland, 2, 1)).astype(np.uint8))
    mr = labels.with_data(np.where(labels.data == 2, 300.0, 900.0 * (labels.data > 0)).astype(np.float32))
    volumes = {"breast_mask": mask, "labels": labels, "mr": mr}
    fields = segment_fields(volumes, old.chest_wall, old.nipple, laterality, {})
    write_artefact(path, header("segment", laterality), fields)


def _true_projection(view):
    """The compressed breast on a grid of its own, projected."""
    axis = np.arange(-90.0, 90.1, 1.5)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    back = compression(view).inverse(points.reshape(-1, 3)).reshape(points.shape)
    breast = (np.abs(back[..., [0, 2]]) < HALF_WIDTH).all(-1) & (back[..., 1] < 0) & (back[..., 1] > -DEPTH)
    gland = np.linalg.norm(back - GLAND, axis=-1) < 9.0
    attenuation = np.where(breast, np.where(gland, 0.076727, 0.051255), 0.0).astype(np.float32)
    return project_volume(Volume(attenuation, np.full(3, -90.0), np.full(3, 1.5)), geometry(view), STEP)


def _add_mammogram(path: Path, laterality, view):
    old = PoseRecord(Artefact(path))
    image = np.repeat(np.repeat(_true_projection(view), STEP, axis=0), STEP, axis=1)[:ROWS, :COLUMNS]
    pose = PoseFields(
        view=old.geometry,
        rigid=old.geometry,
        maps={name: old.affine(name) for name in ("rigid", "scaling")},
        mammogram=image.astype(np.float32),
        tissue=(image > 0.5).astype(np.uint8),
    )
    write_artefact(path, header("pose", laterality, view), pose.fields())


def _inputs(folder, laterality="R", view="CC"):
    inputs = write_case(folder, laterality, views=(view,))
    _segment(inputs["segment"][0], laterality)
    _add_mammogram(inputs["pose"][0], laterality, view)
    return inputs


def _run(inputs, folder, laterality="R", view="CC"):
    output = folder / f"project.{view}.h5"
    run_stage("project", inputs, output, {}, Subject("case1", laterality, view))
    return Artefact(output)


@pytest.fixture(scope="module")
def projected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("project")
    return _run(_inputs(folder), folder)


def test_xarray_opens_the_deformed_volumes(projected):
    check_volumes(projected, {"plate/mr", "updated/mr"})


@pytest.mark.parametrize("method", ["scaling", "plate", "updated"])
def test_true_deformation_gives_the_mammogram(projected, method):
    assert projected.ok
    true = _true_projection("CC")
    image, mask = projected.array(f"{method}/projection", "1"), projected.array(f"{method}/mask", "1")
    assert image.shape == mask.shape == true.shape
    shadow = true > 0.05
    assert 2 * (mask.astype(bool) & shadow).sum() / (mask.sum() + shadow.sum()) > 0.97
    assert projected.value(f"{method}_ncc") > 0.9
    # The voxels of the mask stop 1 mm short of the box on each side.
    assert np.median((true - image)[true > 2.5]) == pytest.approx(2 * 0.7 * ATTENUATION_20KEV_PER_MM[1], abs=0.02)
    assert projected.value("step") == STEP
    assert round(0.8 / PIXEL_MM) <= STEP


def test_rigid_breast_is_thicker_and_correlates_less(projected):
    assert projected.array("rigid/projection", "1").max() > projected.array("plate/projection", "1").max()
    assert projected.value("rigid_ncc") < projected.value("plate_ncc")


def test_deformed_mr_volume_lies_in_the_plate_frame(projected):
    assert projected.volume_names() == ["plate/mr", "updated/mr"]
    volume = projected.volume("plate/mr", "1", frame="plate")
    gland = compression("CC").forward(GLAND[None])
    fat = compression("CC").forward(np.array([[-25.0, -50.0, -20.0]]))
    assert volume.sample(gland) == pytest.approx(300.0, abs=40.0)
    assert volume.sample(fat) == pytest.approx(900.0, abs=1.0)


def test_left_breast_gives_the_same_projection(projected, tmp_path):
    left = _run(_inputs(tmp_path, "L"), tmp_path, "L")
    for method in ("rigid", "updated"):
        mine, other = projected.array(f"{method}/projection", "1"), left.array(f"{method}/projection", "1")
        assert np.abs(mine - other).max() < 1e-3


def test_failed_solution_leaves_the_other_methods_and_its_message(tmp_path):
    inputs = _inputs(tmp_path)
    inputs["solve"] = [write_failed(tmp_path / "failed.h5", "R", "solve", "CC")]
    got = _run(inputs, tmp_path)
    assert (got.status, got.message) == ("failed", "solve: went wrong")
    assert got.has("plate/projection")
    assert not got.has("updated/projection")


def test_failed_pose_is_passed_on(tmp_path):
    inputs = _inputs(tmp_path)
    inputs["pose"] = [write_failed(tmp_path / "failed.h5", "R", "pose", "CC")]
    got = _run(inputs, tmp_path)
    assert (got.status, got.message) == ("failed", "pose: went wrong")
    assert got.names() == []


def test_parallel_view_without_mammogram_is_projected_but_not_compared(tmp_path):
    inputs = write_case(tmp_path, "R", views=("3D",))
    _segment(inputs["segment"][0], "R")
    got = _run(inputs, tmp_path, view="3D")
    assert got.has("updated/projection")
    assert not got.has("updated_ncc")
    view = replace(geometry("3D"), parallel=True)
    area = got.array("updated/mask", "1").sum() * (STEP * PIXEL_MM / view.middle_magnification) ** 2
    behind_edge = 2.0 * HALF_WIDTH * 0.7**-0.5 * DEPTH * 0.7**-0.5
    assert area == pytest.approx(behind_edge, rel=0.06)
