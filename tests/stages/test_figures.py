"""Stage `figures`: pictures for whatever a case came to, and exports that lie where they should."""

from pathlib import Path
from typing import Any

import meshio
import nibabel
import numpy as np
import pytest
import SimpleITK
from PIL import Image

from mammoreg.geometry import breast_to_lps, lps_to_breast, plate_to_breast
from mammoreg.geometry.frames import Laterality
from stages.engine.artefact import Artefact
from stages.pose.record import PoseRecord
from tests.stages import synthetic_case as synthetic
from tests.stages.pictured_case import (
    LESION,
    LESION_DIAMETER_MM,
    MR_AFFINE,
    MR_SHAPE,
    run_figures,
    world_centroid,
    write_pictured_case,
)

Case = tuple[Path, dict[str, Any], Laterality]


@pytest.fixture(scope="module", params=["R", "L"])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A right and a left breast with CC and MLO, after stage `figures`."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    inputs = write_pictured_case(folder, request.param, ("CC",))
    run_figures(folder, inputs, request.param)
    return folder, inputs, request.param


def read_picture(path: Path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture)


def between_plates(points: np.ndarray, laterality: Laterality) -> np.ndarray:
    """The synthetic truth: LPS points of the undeformed breast, carried between the plates of the CC, LPS."""
    placed = synthetic.compression("CC").forward(lps_to_breast(points, laterality))
    return breast_to_lps(plate_to_breast(placed, synthetic.geometry("CC").angle_deg), laterality)


def test_all_pictures_are_drawn_and_listed(case: Case) -> None:
    folder, _, _ = case
    listed = [picture["name"] for picture in Artefact(folder / "figures.h5").value("pictures")]
    assert listed == ["overview", "landmarks", "outlines", "mesh", "segmentation"]
    for name in listed:
        assert read_picture(folder / "figures" / f"{name}.png").shape[1] > 400


def test_the_predicted_lesion_on_the_mr_grid_lies_at_the_lesion(case: Case) -> None:
    folder, _, laterality = case
    path = folder / "export" / "lesion_0_updated_mr.nii.gz"
    image = nibabel.load(path)
    assert image.shape == MR_SHAPE
    np.testing.assert_allclose(image.affine, MR_AFFINE, atol=1e-4)
    expected = breast_to_lps(LESION, laterality)
    # One view sees the lesion along a beam; the other two directions are determined.
    assert np.abs(world_centroid(path) - expected)[:2].max() < 3.0


def test_the_predicted_lesion_on_the_mammogram_covers_the_marked_one(case: Case) -> None:
    folder, _, _ = case
    predicted = read_picture(folder / "export" / "lesion_0_updated_CC.png") > 0
    marked = read_picture(folder / "CC.png") > 0
    assert predicted.shape == marked.shape
    shift = np.argwhere(predicted).mean(axis=0) - np.argwhere(marked).mean(axis=0)
    assert np.abs(shift).max() < 2.0
    assert predicted.sum() * synthetic.PIXEL_MM**2 > np.pi / 4 * LESION_DIAMETER_MM**2


def test_stored_and_canonical_masks_are_inverse(case: Case) -> None:
    folder, _, _ = case
    pose = PoseRecord(Artefact(folder / "pose.CC.h5"))
    stored = read_picture(folder / "CC.png") > 0
    np.testing.assert_array_equal(pose.stored_image(pose.canonical_image(stored)), stored)


def test_itk_reads_the_displacement_in_lps(case: Case) -> None:
    folder, _, laterality = case
    image = SimpleITK.ReadImage(str(folder / "export" / "displacement_CC_updated.nii.gz"))
    assert image.GetNumberOfComponentsPerPixel() == 3
    points = breast_to_lps(np.array([[-10.0, -40.0, 12.0], [20.0, -20.0, -8.0]]), laterality)
    for point in points:
        index = image.TransformPhysicalPointToIndex(point.tolist())
        voxel = np.array(image.TransformIndexToPhysicalPoint(index))
        moved = between_plates(voxel[None], laterality)[0] - voxel
        np.testing.assert_allclose(image[index], moved, atol=1e-3)


def test_the_deformed_volume_lies_where_the_deformation_carries_the_breast(case: Case) -> None:
    folder, _, laterality = case
    image = nibabel.load(folder / "export" / "mr_CC_updated.nii.gz")
    inside = np.argwhere(np.asarray(image.dataobj) > 10.0)
    world = nibabel.affines.apply_affine(image.affine, inside) * [-1, -1, 1]
    breast = Artefact(folder / "segment.h5").volume("breast_mask")
    carried = between_plates(breast.centres(breast.data != 0), laterality)
    np.testing.assert_allclose(world.mean(axis=0), carried.mean(axis=0), atol=0.7)
    np.testing.assert_allclose(world.std(axis=0), carried.std(axis=0), rtol=0.05)


def test_itk_places_the_deformed_volume_like_nibabel(case: Case) -> None:
    path = case[0] / "export" / "mr_CC_updated.nii.gz"
    placed = np.array(SimpleITK.ReadImage(str(path)).TransformIndexToPhysicalPoint((5, 20, 10)))
    expected = nibabel.affines.apply_affine(nibabel.load(path).affine, [5, 20, 10]) * [-1, -1, 1]
    np.testing.assert_allclose(placed, expected, atol=1e-3)


def test_meshes_are_right_handed_in_lps(case: Case) -> None:
    folder, _, laterality = case
    before = meshio.read(folder / "export" / "mesh.vtu")
    after = meshio.read(folder / "export" / "mesh_CC_updated.vtu")
    for mesh in (before, after):
        corners = mesh.points[mesh.cells_dict["hexahedron"]]
        edges = [corners[:, i] - corners[:, 0] for i in (1, 3, 4)]
        assert (np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2]) > 0).all()
    np.testing.assert_allclose(after.points, between_plates(before.points, laterality), atol=1e-9)
    np.testing.assert_allclose(after.point_data["displacement_mm"], after.points - before.points, atol=1e-9)


def test_a_second_volume_shows_landmarks_between_the_plates_and_a_rerun_is_identical(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("3D",))
    figures = run_figures(tmp_path, inputs)
    names = [picture["name"] for picture in figures.value("pictures")]
    assert "landmarks_3d" in names
    assert "overview" not in names
    before = {name: (tmp_path / name).read_bytes() for name in ["figures.h5", *figures.value("files")]}
    run_figures(tmp_path, inputs)
    for name, content in before.items():
        assert (tmp_path / name).read_bytes() == content, name


def test_what_a_failed_stage_left_is_still_drawn(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("CC",))
    synthetic.write_failed(inputs["pose"][0], "R", "pose", "CC", "no breast in the mammogram")
    del inputs["project"]
    figures = run_figures(tmp_path, inputs)
    assert (figures.status, figures.message) == ("failed", "pose: no breast in the mammogram")
    assert [picture["name"] for picture in figures.value("pictures")] == ["segmentation"]
    assert "export/mesh.vtu" in figures.value("files")


def test_a_failed_segmentation_leaves_no_picture(tmp_path: Path) -> None:
    path = synthetic.write_failed(tmp_path / "segment.h5", "R", "segment")
    figures = run_figures(tmp_path, {"segment": [path]})
    assert figures.status == "failed"
    assert figures.value("files") == []
