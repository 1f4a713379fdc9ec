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
from stages.cohort.readers.marks.points import read_points
from stages.engine.artefact import Artefact
from stages.figures.exports import file_names
from stages.formats.vtu import FRAME_FIELD
from stages.pose.record import PoseRecord
from tests.stages import synthetic_case as synthetic
from tests.stages.pictured_case import (
    FLIPS,
    LESION,
    LESION_DIAMETER_MM,
    MR_AFFINE,
    MR_SHAPE,
    run_figures,
    run_per_case,
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


def between_plates(points: np.ndarray, laterality: Laterality, view: str = "CC") -> np.ndarray:
    """The synthetic truth: LPS points of the undeformed breast, carried between the plates of a view, LPS."""
    placed = synthetic.compression(view).forward(lps_to_breast(points, laterality))
    return breast_to_lps(plate_to_breast(placed, synthetic.geometry(view).angle_deg), laterality)


def mr_landmarks_of(inputs: dict[str, Any]) -> dict[str, np.ndarray]:
    return read_points(inputs["mr_landmarks"])


def test_all_pictures_are_drawn_and_listed(case: Case) -> None:
    folder, _, _ = case
    listed = [picture["name"] for picture in Artefact(folder / "figures.h5").value("pictures")]
    assert listed == ["overview", "landmarks", "outlines", "mesh", "segmentation"]
    for name in listed:
        assert read_picture(folder / "figures" / f"{name}.png").shape[1] > 400


def test_the_predicted_lesion_on_the_mr_grid_lies_at_the_lesion(case: Case) -> None:
    folder, _, laterality = case
    path = folder / "export" / "lesion_lesion_updated_mr.nii.gz"
    image = nibabel.load(path)
    assert image.shape == MR_SHAPE
    np.testing.assert_allclose(image.affine, MR_AFFINE, atol=1e-4)
    expected = breast_to_lps(LESION, laterality)
    # One view sees the lesion along a beam; the other two directions are determined.
    assert np.abs(world_centroid(path) - expected)[:2].max() < 3.0


def test_the_predicted_lesion_on_the_mammogram_covers_the_marked_one(case: Case) -> None:
    folder, _, _ = case
    predicted = read_picture(folder / "export" / "lesion_lesion_updated_CC.png") > 0
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


def read_transform(folder: Path, name: str) -> SimpleITK.Transform:
    return SimpleITK.ReadTransform(str(folder / "export" / f"{name}.h5"))


def carried_by(transform: SimpleITK.Transform, points: np.ndarray) -> np.ndarray:
    return np.array([transform.TransformPoint(point.tolist()) for point in points])


def inner_points(laterality: Laterality) -> np.ndarray:
    """Points all over the breast, up to its skin, LPS."""
    return breast_to_lps(synthetic.box().subdivide(2).points, laterality)


def test_both_transforms_carry_points_of_the_breast_up_to_its_skin_and_back(case: Case) -> None:
    folder, _, laterality = case
    points = inner_points(laterality)
    forward = carried_by(read_transform(folder, "displacement_CC_updated_forward"), points)
    np.testing.assert_allclose(forward, between_plates(points, laterality), atol=0.02)
    back = carried_by(read_transform(folder, "displacement_CC_updated_inverse"), forward)
    np.testing.assert_allclose(back, points, atol=0.05)


@pytest.mark.parametrize("way", ["forward", "inverse"])
def test_itk_reads_the_same_field_from_nifti_and_from_the_transform(case: Case, way: str) -> None:
    folder, _, laterality = case
    name = f"displacement_CC_updated_{way}"
    field = SimpleITK.ReadImage(str(folder / "export" / f"{name}.nii.gz"))
    assert field.GetNumberOfComponentsPerPixel() == 3
    points = inner_points(laterality)[::7]
    from_nifti = SimpleITK.DisplacementFieldTransform(SimpleITK.Cast(field, SimpleITK.sitkVectorFloat64))
    np.testing.assert_allclose(
        carried_by(from_nifti, points), carried_by(read_transform(folder, name), points), atol=1e-3
    )


def test_the_fields_masks_hold_the_breast_before_and_between_the_plates(case: Case) -> None:
    folder, _, laterality = case
    block = synthetic.box().subdivide(2)
    middle = block.points.mean(axis=0)
    within = middle + 0.96 * (block.points - middle)
    beyond = middle + 1.06 * (block.points[block.skin_nodes()] - middle)
    for way in ("forward", "inverse"):
        path = folder / "export" / f"displacement_CC_updated_{way}_mask.nii.gz"
        mask = SimpleITK.ReadImage(str(path))
        for points, held in ((within, 1), (beyond, 0)):
            places = breast_to_lps(points, laterality)
            places = places if way == "forward" else between_plates(places, laterality)
            found = [mask[mask.TransformPhysicalPointToIndex(place.tolist())] for place in places]
            assert found == [held] * len(found)


def test_resampling_with_the_inverse_shows_the_volume_between_the_plates(case: Case) -> None:
    folder, _, _ = case
    breast = Artefact(folder / "segment.h5").volume("mr")
    undeformed = SimpleITK.GetImageFromArray(np.asarray(breast.data, dtype=np.float32).transpose(2, 1, 0))
    undeformed.SetOrigin(breast.origin.tolist())
    undeformed.SetSpacing(breast.spacing.tolist())
    exported = SimpleITK.ReadImage(str(folder / "export" / "mr_CC_updated.nii.gz"), SimpleITK.sitkFloat32)
    transform = read_transform(folder, "displacement_CC_updated_inverse")
    shown = SimpleITK.Resample(undeformed, exported, transform, SimpleITK.sitkLinear, 0.0)
    ours, theirs = (SimpleITK.GetArrayFromImage(image).ravel() for image in (exported, shown))
    assert np.corrcoef(ours, theirs)[0, 1] > 0.97


def test_the_readme_says_which_points_go_where(case: Case) -> None:
    text = (case[0] / "export" / "README.txt").read_text()
    assert "forward   takes a point of the undeformed breast" in text
    assert "resampling asks for each voxel of the result where it came from" in text


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
    assert FRAME_FIELD in before.field_data


@pytest.mark.parametrize("laterality", ["R", "L"])
def test_exports_of_a_second_volumes_view_lie_on_that_volume(tmp_path: Path, laterality: Laterality) -> None:
    inputs = write_pictured_case(tmp_path, laterality, ("3D",))
    run_figures(tmp_path, inputs, laterality)
    rows = [r for r in Artefact(inputs["localize"][0]).value("compressed_rows") if r["method"] == "updated"]
    table = np.array([[row[axis] for axis in "xyz"] for row in rows])
    marked = mr_landmarks_of(inputs)
    points = np.array([marked[row["name"]] for row in rows])
    forward, inverse = (read_transform(tmp_path, f"displacement_3D_updated_{way}") for way in ("forward", "inverse"))
    np.testing.assert_allclose(carried_by(forward, points), table, atol=0.05)
    np.testing.assert_allclose(carried_by(inverse, table), points, atol=0.05)
    # The shift itself is known: without it all of this would lie 7.8 mm away.
    shift = breast_to_lps(synthetic.SECOND_VOLUME_SHIFT, laterality)
    np.testing.assert_allclose(table - between_plates(points, laterality, "3D"), np.tile(shift, (2, 1)), atol=0.5)
    mesh = meshio.read(tmp_path / "export" / "mesh_3D_updated.vtu")
    carried = carried_by(forward, meshio.read(tmp_path / "export" / "mesh.vtu").points)
    np.testing.assert_allclose(carried, mesh.points, atol=0.05)
    second = Artefact(inputs["segment"][0]).volume("compressed_mask")
    body = nibabel.load(tmp_path / "export" / "mr_3D_updated.nii.gz")
    inside = np.argwhere(np.asarray(body.dataobj) > 10.0)
    world = nibabel.affines.apply_affine(body.affine, inside) * [-1, -1, 1]
    assert np.mean(second.sample(world, order=0) > 0.5) > 0.96


def test_a_view_that_cannot_be_placed_on_its_second_volume_is_not_exported(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("3D",))
    del inputs["localize"]
    figures = run_figures(tmp_path, inputs)
    names = [name for name in figures.value("files") if name.startswith("export/")]
    assert sorted(names) == ["export/README.txt", "export/mesh.vtu"]


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


def test_a_case_with_its_share_of_compression_alone_is_drawn_and_exported(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("3D",), outlined=False)
    figures = run_figures(tmp_path, inputs)
    assert figures.status == "ok"
    assert [picture["name"] for picture in figures.value("pictures")] == ["mesh", "segmentation"]
    points = inner_points("R")
    forward = carried_by(read_transform(tmp_path, "displacement_3D_updated_forward"), points)
    np.testing.assert_allclose(forward, between_plates(points, "R", "3D"), atol=0.02)


def test_one_name_is_one_lesion_in_the_files_of_both_sides(tmp_path: Path) -> None:
    inputs = write_pictured_case(tmp_path, "R", ("CC",))
    places = {"mass": LESION, "cyst 2": np.array([-20.0, -30.0, -14.0])}
    rows = [f"{name}\t" + "\t".join(f"{x:.3f}" for x in place) + "\t9" for name, place in places.items()]
    inputs["mr_lesion"].write_text("\n".join(["name\tx\ty\tz\tdiameter_mm", *rows, ""]))
    column, row = synthetic.stored(synthetic.true_pixel("CC", places["cyst 2"]), FLIPS)
    inputs["lesion_CC"] = tmp_path / "cyst.tsv"
    inputs["lesion_CC"].write_text(f"name\tcolumn\trow\tdiameter_mm\ncyst 2\t{column:.2f}\t{row:.2f}\t9\n")
    inputs["localize"] = [run_per_case("localize", tmp_path, inputs)]
    run_figures(tmp_path, inputs)
    names = [path.name for path in (tmp_path / "export").iterdir()]
    assert "lesion_cyst_2_updated_CC.png" in names
    assert "lesion_mass_updated_CC.png" in names
    assert "lesion_mass_updated_mr.nii.gz" not in names, "no mammogram marks it"
    found = world_centroid(tmp_path / "export" / "lesion_cyst_2_updated_mr.nii.gz")
    assert np.abs(found - places["cyst 2"])[:2].max() < 3.0
    assert (tmp_path / "export" / "lesions.tsv").read_text().splitlines()[1:] == [
        "mass\tmass\tmr",
        "cyst_2\tcyst 2\tmr+mammograms",
    ]


def test_names_of_lesions_are_fit_for_files_and_stay_apart() -> None:
    assert file_names(["mass", "calc 1", "calc/1", "calc_1"]) == {
        "mass": "mass",
        "calc 1": "calc_1",
        "calc/1": "calc_1_2",
        "calc_1": "calc_1_3",
    }
