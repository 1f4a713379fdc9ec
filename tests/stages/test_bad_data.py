"""Data that only a stage can find bad: the case ends as an artefact whose message says what to do."""

import re

import numpy as np
import pytest
from PIL import Image

from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from tests.stages.cohort_files import write_dicom, write_volume
from tests.stages.synthetic_case import header, write_mesh, write_segment
from tests.unit.mammogram_images import PIXEL_MM, breast_image

SHAPE = (40, 44, 48)


def _segment(folder, data):
    write_volume(folder / "mr.nii.gz", data.astype(np.float32))
    run_stage("segment", {"mr": folder / "mr.nii.gz"}, folder / "segment.h5", {}, Subject("c1"))
    return Artefact(folder / "segment.h5")


def _pose(folder, image, row):
    segment, mesh = write_segment(folder / "segment.h5", "R"), write_mesh(folder / "mesh.h5", "R")
    write_artefact(folder / "calibrate.h5", header("calibrate", "R"), Fields(values={"mu_kpa": 9.4}))
    inputs = {"segment": segment, "mesh": mesh, "calibrate": folder / "calibrate.h5", "image": image}
    # This breast has no tissues.
    run_stage("pose", inputs, folder / "pose.CC.h5", {"use_density": False}, Subject("c1", "R", "CC", row))
    return Artefact(folder / "pose.CC.h5")


def _picture(folder, pixels):
    """A right CC as usually stored: the chest wall in the last column."""
    path = folder / "cc.png"
    Image.fromarray(np.clip(pixels[:, ::-1] * 20, 0, 65535).astype(np.uint16)).save(path)
    return path


def test_nan_in_the_volume(tmp_path):
    data = np.random.default_rng(1).normal(100, 10, SHAPE)
    data[3, 4, 5] = np.nan
    found = _segment(tmp_path, data)
    assert found.status == "failed"
    assert (
        found.message
        == "segment: mr.nii.gz: holds values that are not finite (NaN or infinite); export the volume again"
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (np.zeros(SHAPE), "constant or almost empty: hand in the volume of intensities"),
        (np.random.default_rng(1).rayleigh(10.0, SHAPE), "no b(reast|ody)"),
    ],
    ids=["empty", "noise"],
)
def test_volume_without_breast(tmp_path, data, message):
    found = _segment(tmp_path, data)
    assert found.status == "failed"
    assert found.message.startswith("segment: ")
    assert re.search(message, found.message)


def test_truncated_volume(tmp_path):
    path = write_volume(tmp_path / "mr.nii", np.ones(SHAPE, np.float32))
    path.write_bytes(path.read_bytes()[:-5000])
    run_stage("segment", {"mr": path}, tmp_path / "segment.h5", {}, Subject("c1"))
    found = Artefact(tmp_path / "segment.h5")
    assert found.status == "failed"
    assert "mr.nii" in found.message
    assert str(tmp_path) not in found.message


@pytest.mark.parametrize("pixels", [np.full((640, 400), 100.0), np.random.default_rng(1).normal(100, 2, (640, 400))])
def test_mammogram_without_breast(tmp_path, pixels):
    found = _pose(tmp_path, _picture(tmp_path, pixels), {"pixel_spacing_mm": "0.25", "thickness_mm": "50"})
    assert found.status == "failed"
    assert "no breast found in the mammogram" in found.message


def test_truncated_mammogram(tmp_path):
    path = write_dicom(tmp_path / "cc.dcm")
    path.write_bytes(path.read_bytes()[:-500])
    found = _pose(tmp_path, path, {})
    assert found.status == "failed"
    assert "cc.dcm: pixels are missing or truncated; export the image again" in found.message


def test_thickness_larger_than_the_breast(tmp_path):
    image = _picture(tmp_path, breast_image())
    found = _pose(tmp_path, image, {"pixel_spacing_mm": str(PIXEL_MM), "thickness_mm": "95"})
    assert found.status == "failed"
    assert "the compressed thickness of 95.0 mm is not below the uncompressed breast's 90.0 mm" in found.message
    assert "correct thickness_mm in the views table (or the header)" in found.message
