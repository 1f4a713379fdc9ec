"""With the true displacement of the twins in place of a model, localisation is left with its own error alone."""

from dataclasses import dataclass

import h5py
import numpy as np
import pytest
from scipy.spatial import cKDTree

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.geometry.frames import plate_rotation
from mammoreg.localization.deformation import MethodView
from mammoreg.localization.grid import BreastGrid, BreastInView
from mammoreg.localization.lesions import LesionArea, MaskLesion, area_from_mask
from mammoreg.localization.to_mammogram import project_landmarks, project_lesion
from mammoreg.localization.to_mr import MrPrediction, locate_in_breast
from mammoreg.metrics.distances import detector_distance_mm
from stages.cohort.readers.marks.masks import read_image_mask, read_masks
from tests.shared_data import DATA, requires_shared

TWINS = DATA / "twins"
PIXEL_MM = 0.2
pytestmark = requires_shared("twins/truth")


@dataclass(frozen=True)
class TrueDeformation:
    """The solver's displacement, by the nearest voxel that has one."""

    positions: Points
    displacements: Points
    rotation: np.ndarray

    def forward(self, points_breast: Points) -> Points:
        _, nearest = cKDTree(self.positions).query(points_breast)
        return (points_breast + self.displacements[nearest]) @ self.rotation.T

    def inverse(self, points_plate: Points) -> Points:
        carried = (self.positions + self.displacements) @ self.rotation.T
        distance, nearest = cKDTree(carried).query(points_plate)
        found = points_plate @ self.rotation - self.displacements[nearest]
        found[distance > 2.0] = np.nan
        return found


@dataclass(frozen=True)
class Twin:
    """A twin's true views (right breasts: the breast frame is LPS), its lesions and points."""

    views: dict[str, MethodView]
    areas: dict[str, LesionArea]
    lesion: MaskLesion
    grid: BreastGrid
    points: Points
    pixels: dict[str, np.ndarray]


def load(case: str) -> Twin:
    views, areas, pixels = {}, {}, {}
    with h5py.File(TWINS / "truth" / f"{case}.h5") as file:
        points = file["points_lps"][()]
        for view in ("CC", "MLO"):
            stored = read_image_mask(TWINS / "mg" / f"{case}_{view}_lesion.png")
            rows, columns = stored.shape
            areas[view] = area_from_mask(stored[:, ::-1])  # right breasts, chest wall at the right edge
            found = file[view]["points_column_row"][()]
            pixels[view] = np.stack([columns - 1 - found[:, 0], found[:, 1]], axis=1)
            views[view], mask = _view(file[view], rows, columns, points, pixels[view])
    lesion = MaskLesion(read_masks(TWINS / "mr" / f"{case}_lesion.nii.gz")["lesion"])
    return Twin(views, areas, lesion, BreastGrid(mask), points, pixels)


def _view(group: h5py.Group, rows: int, columns: int, points: Points, pixels: np.ndarray) -> tuple[MethodView, Volume]:
    """One view with its true geometry; the middle row's place follows from the points (README)."""
    told, field = group.attrs, group["displacement"]
    rotation = plate_rotation(float(told["true_roll_deg"]))
    values, voxel = field[()], float(field.attrs["voxel_mm"])
    known = (values != int(field.attrs["missing"])).all(axis=-1)
    origin = np.asarray(field.attrs["grid_origin_lps"]) + voxel * np.asarray(field.attrs["index_origin"])
    mask = Volume(known, origin, np.full(3, voxel))
    deformation = TrueDeformation(mask.centres(known), values[known] * 0.01, rotation)
    lower = float(told["plate_lower"]) + float(rotation[2] @ told["centre"])
    edge, gap = float(told["edge_y"] + told["centre"][1]), float(told["gap_mm"])
    angle = float(told["true_roll_deg"])
    geometry = ViewGeometry(angle, edge, 0.0, lower, gap, 650.0, 15.0, PIXEL_MM, rows, columns)
    between = group["points_between_plates_lps"][()] @ rotation.T
    offsets = (geometry.project(between)[:, 1] - pixels[:, 1]) * PIXEL_MM / geometry.magnification(between[:, 2])
    middle = float(np.median(offsets))
    geometry = ViewGeometry(angle, edge, middle, lower, gap, 650.0, 15.0, PIXEL_MM, rows, columns)
    return MethodView(deformation, geometry), mask


@pytest.fixture(scope="module", params=["twin1", "twin4"])
def twin(request: pytest.FixtureRequest) -> Twin:
    return load(request.param)


@pytest.mark.parametrize("view", ["CC", "MLO"])
def test_points_project_where_the_truth_has_them(twin: Twin, view: str) -> None:
    predicted, _ = project_landmarks(twin.views[view], twin.points)
    distance = detector_distance_mm(predicted, twin.pixels[view], twin.views[view].geometry)
    assert np.median(distance) < 0.4
    assert distance.max() < 1.5


@pytest.mark.parametrize("view", ["CC", "MLO"])
def test_lesion_projects_onto_the_mark(twin: Twin, view: str) -> None:
    lesion = project_lesion(twin.views[view], twin.lesion.body())
    geometry = twin.views[view].geometry
    assert lesion.seen
    assert detector_distance_mm(lesion.centre, twin.areas[view].centre, geometry) < 0.6


@pytest.fixture(scope="module")
def from_two_views(twin: Twin) -> MrPrediction:
    return locate_in_breast({name: BreastInView(view, twin.grid) for name, view in twin.views.items()}, twin.areas)


def test_two_marks_meet_in_the_lesion(twin: Twin, from_two_views: MrPrediction) -> None:
    assert from_two_views.region is not None
    assert np.linalg.norm(from_two_views.point - twin.lesion.centre) < 1.0
    assert from_two_views.beam_gap_mm is not None
    assert from_two_views.beam_gap_mm < 1.5
