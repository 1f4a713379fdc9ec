"""Projection of volumes: against analytic line integrals, the geometry of points, and another program's mammogram."""

import csv
import json
from dataclasses import replace

import h5py
import nibabel
import numpy as np
import pydicom
import pytest

from mammoreg.geometry import ViewGeometry, Volume, breast_to_plate
from mammoreg.imaging.correlation import correlation
from mammoreg.materials.attenuation import ATTENUATION_20KEV_PER_MM, attenuation_map
from mammoreg.projection.comparison import block_mean, projection_correlation
from mammoreg.projection.cone_beam import detector_pixels, project_volume
from tests.shared_data import DATA, requires_shared

VIEW = ViewGeometry(
    angle_deg=0.0, edge_p_mm=5.0, middle_mm=-3.0, height_mm=-20.0, thickness_mm=50.0, source_detector_mm=600.0,
    support_detector_mm=12.0, pixel_mm=0.25, rows=600, columns=400,
)  # fmt: skip


def _grid(spacing=1.0):
    axes = [np.arange(-70.0, 64.0, spacing), np.arange(-90.0, 10.0, spacing), np.arange(-19.5, 30.0, spacing)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return points, np.array([axis[0] for axis in axes]), np.full(3, spacing)


def _chord_mm(view, step, centre, radius):
    """Length of every beam inside a sphere."""
    rows, columns = detector_pixels(view, step)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    foot = view.back_project(pixels, np.full(pixels.shape[:2], view.detector_height_mm))
    direction = foot - view.source
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    offset = np.asarray(centre) - view.source
    off_axis = offset - (direction @ offset)[..., None] * direction
    return 2.0 * np.sqrt(np.maximum(radius**2 - (off_axis**2).sum(axis=-1), 0.0))


def test_sphere_casts_the_chords_of_a_cone_beam():
    centre, radius = np.array([12.0, -45.0, 8.0]), 18.0
    points, origin, spacing = _grid()
    # Smooth partial volumes: the border voxels hold the share of the ball.
    share = np.clip(radius + 0.5 - np.linalg.norm(points - centre, axis=-1), 0.0, 1.0)
    image = project_volume(Volume(share.astype(np.float32), origin, spacing), VIEW, 4)
    chord = _chord_mm(VIEW, 4, centre, radius)
    inner = chord > 20.0  # nearer to the border a chord changes by more than voxels resolve
    assert np.abs(image - chord)[inner].max() < 0.4
    assert (image - chord)[inner].mean() == pytest.approx(0.0, abs=0.05)
    assert image.sum() == pytest.approx(chord.sum(), rel=2e-3)


def test_box_is_as_long_as_its_beams_are_oblique():
    points, origin, spacing = _grid()
    image = project_volume(Volume(np.ones(points.shape[:3], np.float32), origin, spacing), VIEW, 8)
    rows, columns = detector_pixels(VIEW, 8)
    along = (rows - 299.5) * VIEW.pixel_mm
    forward = (columns + 0.5) * VIEW.pixel_mm
    cosine = 600.0 / np.sqrt(600.0**2 + along[:, None] ** 2 + forward[None] ** 2)
    inner = np.s_[20:-20, 1:30]
    assert image[inner] == pytest.approx((50.0 / cosine)[inner], rel=1e-4)


def test_small_ball_appears_where_its_centre_is_projected():
    points, origin, spacing = _grid()
    for centre in ([20.0, -60.0, -12.0], [-40.0, -20.0, 25.0]):
        ball = (np.linalg.norm(points - centre, axis=-1) < 4.0).astype(np.float32)
        image = project_volume(Volume(ball, origin, spacing), VIEW, 2)
        rows, columns = detector_pixels(VIEW, 2)
        found = [(image.sum(axis=0) * columns).sum() / image.sum(), (image.sum(axis=1) * rows).sum() / image.sum()]
        assert found == pytest.approx(VIEW.project(np.array(centre)), abs=0.7)


def test_parallel_beams_sum_straight_and_magnify_for_the_middle():
    view = replace(VIEW, parallel=True)
    points, origin, spacing = _grid()
    ball = (np.linalg.norm(points - [10.0, -40.0, 20.0], axis=-1) < 6.0).astype(np.float32)
    image = project_volume(Volume(ball, origin, spacing), view, 1)
    area_mm2 = image.sum() * view.pixel_mm**2 / view.middle_magnification**2
    assert area_mm2 == pytest.approx(ball.sum(), rel=5e-3)


def test_nothing_behind_the_chest_wall_edge_is_imaged():
    points, origin, spacing = _grid()
    behind = (points[..., 1] > VIEW.edge_p_mm + 1.0).astype(np.float32)
    assert project_volume(Volume(behind, origin, spacing), VIEW, 4).max() == 0.0


def test_blocks_of_pixels_are_averaged_and_correlate_with_themselves():
    image = np.arange(12.0 * 18.0, dtype=np.float32).reshape(12, 18) ** 1.5
    blocks = block_mean(image, 4)
    assert blocks.shape == (3, 5)
    assert blocks[0, 0] == pytest.approx(image[:4, :4].mean())
    labels = np.ones(image.shape, dtype=np.uint8)
    full = block_mean(image, 1)
    silhouette = np.ones(full.shape, dtype=bool)
    assert projection_correlation(3.0 * full + 2.0, silhouette, image, labels, 1) == pytest.approx(1.0)
    assert projection_correlation(-full, silhouette, image, labels, 1) == pytest.approx(-1.0)
    assert np.isnan(projection_correlation(full, silhouette, image, 2 * labels, 1))


def test_correlation_needs_contrast():
    flat = np.ones((20, 20))
    assert np.isnan(correlation(flat, np.random.default_rng(0).random((20, 20)), np.ones((20, 20), dtype=bool)))


@requires_shared("reference")
def test_attenuation_is_that_of_the_reference_table():
    with (DATA / "reference/attenuation_20kev.csv").open() as file:
        per_cm = {row["material"]: float(row["mu_per_cm"]) for row in csv.DictReader(file)}
    for label, material in ((1, "adipose"), (2, "glandular"), (3, "skin"), (4, "muscle")):
        assert ATTENUATION_20KEV_PER_MM[label] == pytest.approx(per_cm[material] / 10.0, rel=1e-6)
    assert ATTENUATION_20KEV_PER_MM[0] == 0.0


@requires_shared("victre")
def test_victre_labels_between_the_plates_give_its_mammogram():
    nifti = nibabel.load(DATA / "victre/mr_compressed_labels.nii.gz")
    labels = np.asarray(nifti.dataobj).astype(np.uint8)
    assert np.all(np.diag(nifti.affine)[:2] < 0)  # array axes run to L, P, S
    origin = nifti.affine[:3, 3] * [-1.0, -1.0, 1.0]
    volume = Volume(attenuation_map(labels), origin, np.abs(np.diag(nifti.affine)[:3]))
    true = json.loads((DATA / "victre/truth.json").read_text())["geometry"]
    view = ViewGeometry(
        angle_deg=0.0, edge_p_mm=true["chest_wall_edge_p"], middle_mm=true["detector_middle_l"],
        height_mm=true["support_surface_s"], thickness_mm=true["plate_gap_mm"], source_detector_mm=650.0,
        support_detector_mm=true["support_surface_s"] - true["detector_plane_s"], pixel_mm=true["pixel_mm"],
        rows=true["rows"], columns=true["columns"],
    )  # fmt: skip
    assert view.source == pytest.approx(true["source_lps"], abs=0.02)
    image = project_volume(volume, view, 4)
    pixels = pydicom.dcmread(DATA / "victre/cc.dcm").pixel_array[:, ::-1]
    measured = block_mean(pixels.astype(np.float32) / 1000.0, 4)
    both = (image > 0.3) & (measured > 0.3)
    assert correlation(image, measured, both) > 0.99
    assert (image - measured)[both].mean() == pytest.approx(0.0, abs=0.05)
    first, second = image > 0.15, measured > 0.15
    assert 2 * (first & second).sum() / (first.sum() + second.sum()) > 0.99


@requires_shared("twins")
@pytest.mark.parametrize(("case", "view"), [("twin1", "CC"), ("twin1", "MLO"), ("twin4", "CC"), ("twin4", "MLO")])
def test_points_of_the_twins_appear_where_their_maker_put_them(case, view):
    header = pydicom.dcmread(DATA / f"twins/mg/{case}_{view}.dcm", stop_before_pixels=True)
    with h5py.File(DATA / f"twins/truth/{case}.h5") as file:
        group, true = file[view], dict(file[view].attrs)
        between, pixels = group["points_between_plates_lps"][:], group["points_column_row"][:]
    pixels = pixels * [-1.0, 1.0] + [header.Columns - 1.0, 0.0]  # stored "P, L": columns run from the nipple
    plate = breast_to_plate(between - true["centre"], true["true_roll_deg"])
    geometry = ViewGeometry(
        angle_deg=true["true_roll_deg"], edge_p_mm=true["edge_y"], middle_mm=0.0, height_mm=true["plate_lower"],
        thickness_mm=true["gap_mm"], source_detector_mm=650.0, support_detector_mm=15.0, pixel_mm=0.2,
        rows=header.Rows, columns=header.Columns,
    )  # fmt: skip
    zoom = geometry.magnification(plate[:, 2])
    middle = np.mean(((geometry.project(plate) - pixels)[:, 1]) * 0.2 / zoom)  # not written down by the maker
    found = replace(geometry, middle_mm=float(middle)).project(plate)
    assert found == pytest.approx(pixels, abs=0.02)
