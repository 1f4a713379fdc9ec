"""Pictures: places on axes, orientation, and bytes that depend on the arrays alone."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from PIL import Image
from skimage.color import rgb2lab

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.localization.lesions import LesionArea
from mammoreg.meshing.block import BlockMesh
from mammoreg.plots.accuracy import ErrorPanel, RuntimePoint, error_against_runtime, error_panels
from mammoreg.plots.detector import DetectorImage, draw_area, pixels_to_mm, show_detector_image
from mammoreg.plots.landmarks import ViewLandmarks, landmarks_in_mammograms, landmarks_in_volume
from mammoreg.plots.mesh3d import PlatesPicture, deformed_meshes
from mammoreg.plots.outlines import ViewOutlines, outlines_before_and_after
from mammoreg.plots.overview import LesionColours, LesionCut, ViewLesions, VolumeLesions, lesion_overview
from mammoreg.plots.slices import SliceOverlay, off_slice_mm, shadow, show_slice
from mammoreg.plots.style import (
    LESION_COLOURS,
    METHOD_COLOURS,
    PREDICTED_COLOUR,
    TRUE_COLOUR,
    PicturedBreast,
    grey_window,
    whole_mm,
)
from mammoreg.plots.tissues import BREAST_COLOUR, GLAND_COLOUR, MESH_COLOUR, segmentation
from mammoreg.pose.silhouette import detector_mm

PIXEL_MM = 0.5
LEFT, RIGHT = PicturedBreast("case1", "L"), PicturedBreast("case1", "R")


@pytest.fixture
def image() -> DetectorImage:
    rows, columns = np.mgrid[:200, :140]
    breast = ((rows - 100) / 80) ** 2 + (columns / 110) ** 2 < 1
    return DetectorImage(np.where(breast, 1.0 + rows / 200, 0.0), breast, PIXEL_MM, rows=200)


@pytest.fixture
def volume() -> Volume:
    centres = np.stack(np.meshgrid(*(np.arange(n) for n in (30, 28, 32)), indexing="ij"), axis=-1)
    inside = (((centres - [15, 20, 16]) / [12, 18, 13]) ** 2).sum(axis=-1) < 1
    return Volume(inside.astype(np.float32) * 100, np.array([-60.0, -70.0, -20.0]), np.full(3, 2.0))


def disc(column: int, row: int, radius: int) -> LesionArea:
    step = np.arange(-radius, radius + 1)
    return LesionArea(step[:, None] ** 2 + step**2 <= radius**2, (column - radius, row - radius))


def colours(png: np.ndarray, colour: str) -> int:
    pixels = np.asarray(Image.open(io.BytesIO(png.tobytes())).convert("RGB")).astype(int)
    wanted = 255 * np.array(to_rgba(colour)[:3])
    return int((np.abs(pixels - wanted).max(axis=-1) < 40).sum())


def test_millimetres_on_the_detector_are_those_of_the_view_geometry() -> None:
    view = ViewGeometry(10.0, -20.0, 5.0, -30.0, 50.0, 650.0, 15.0, PIXEL_MM, rows=201, columns=140)
    points = np.random.default_rng(1).normal(0.0, 30.0, (20, 3))
    np.testing.assert_allclose(pixels_to_mm(view.project(points), view.rows, PIXEL_MM), detector_mm(points, view))


@pytest.mark.parametrize(("laterality", "chest_wall_right"), [("R", True), ("L", False)])
def test_breasts_hang_with_the_chest_wall_at_their_side(
    image: DetectorImage, laterality: str, chest_wall_right: bool
) -> None:
    axes = Figure().subplots()
    show_detector_image(axes, image, laterality, "CC", "")
    left, right = axes.get_xlim()
    assert (right < left) == chest_wall_right
    assert min(left, right) == 0.0
    bottom, top = axes.get_ylim()
    assert top < bottom, "row 0, lateral, is on top"


def test_a_thinned_image_covers_the_same_millimetres(image: DetectorImage) -> None:
    thin = DetectorImage(image.pixels[::4, ::4], image.breast[::4, ::4], PIXEL_MM, rows=200, step=4)
    np.testing.assert_allclose(thin.extent, image.extent)


def test_the_border_of_an_area_lies_around_its_place(image: DetectorImage) -> None:
    axes = Figure().subplots()
    draw_area(axes, disc(60, 90, 8), image, TRUE_COLOUR)
    (contour,) = axes.collections
    border = contour.get_paths()[0].vertices
    np.testing.assert_allclose(
        border.mean(axis=0), pixels_to_mm(np.array([60.0, 90.0]), 200, PIXEL_MM), atol=0.3 * PIXEL_MM
    )
    radius = np.linalg.norm(border - border.mean(axis=0), axis=1)
    assert abs(radius.mean() - 8.5 * PIXEL_MM) < PIXEL_MM


@pytest.mark.parametrize("plane", ["axial", "sagittal", "coronal"])
def test_a_mask_on_another_grid_is_drawn_at_its_place(volume: Volume, plane: str) -> None:
    axes = Figure().subplots()
    mask = Volume(np.ones((3, 3, 3)), np.array([-31.0, -31.0, 11.0]), np.ones(3))
    point = np.array([-30.0, -30.0, 12.0])
    show_slice(axes, volume, plane, point, [SliceOverlay(mask, PREDICTED_COLOUR)], "")
    border = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    horizontal, vertical = {"axial": (0, 1), "sagittal": (1, 2), "coronal": (0, 2)}[plane]
    np.testing.assert_allclose(border.mean(axis=0), point[[horizontal, vertical]], atol=0.5)


def test_slices_are_radiological(volume: Volume) -> None:
    axes = Figure().subplots()
    show_slice(axes, volume, "axial", np.array([-30.0, -30.0, 12.0]), [], "")
    assert axes.get_xlim()[0] < axes.get_xlim()[1], "the patient's left is at the right"
    assert axes.get_ylim()[0] > axes.get_ylim()[1], "anterior is on top"


def test_a_slice_beyond_the_volume_is_empty(volume: Volume) -> None:
    axes = Figure().subplots()
    show_slice(axes, volume, "axial", np.array([0.0, 0.0, 500.0]), [SliceOverlay(volume, TRUE_COLOUR)], "")
    assert not axes.images[0].get_array().any()
    assert not axes.collections


def test_grey_window_of_nothing_is_harmless() -> None:
    assert grey_window(np.full((3, 3), np.nan), np.zeros((3, 3), dtype=bool)) == (0.0, 1.0)


def test_overview_shows_what_is_true_and_what_is_predicted_and_is_reproducible(
    image: DetectorImage, volume: Volume
) -> None:
    def picture(true: dict[str, LesionArea], predicted: dict[str, LesionArea]) -> np.ndarray:
        view = ViewLesions("MLO", image, None, true, predicted)
        mr = VolumeLesions(volume, [LesionCut("mass", np.array([-30.0, -30.0, 12.0]))])
        return lesion_overview([view, view], mr, ["mass"], RIGHT, "updated")

    both = picture({"mass": disc(60, 90, 8)}, {"mass": disc(60, 60, 8)})
    neither = picture({}, {})
    for colour in (TRUE_COLOUR, PREDICTED_COLOUR):
        assert colours(both, colour) > colours(neither, colour) + 50
    np.testing.assert_array_equal(both, picture({"mass": disc(60, 90, 8)}, {"mass": disc(60, 60, 8)}))
    text = Image.open(io.BytesIO(both.tobytes())).info
    assert "Software" not in text
    assert "Creation Time" not in text


def figure_of(monkeypatch: pytest.MonkeyPatch, cuts: list[LesionCut], mr: VolumeLesions, names: list[str]) -> Figure:
    """The figure of an overview of one view without lesions, before it becomes a PNG."""
    kept: list[Figure] = []

    def keep(figure: Figure) -> np.ndarray:
        kept.append(figure)
        return np.zeros(0, dtype=np.uint8)

    monkeypatch.setattr("mammoreg.plots.overview.to_png", keep)
    blank = DetectorImage(np.ones((20, 20)), np.ones((20, 20), dtype=bool), PIXEL_MM, rows=20)
    lesion_overview([ViewLesions("CC", blank, None)], mr, names, RIGHT, "updated")
    return kept[0]


def test_one_view_is_cut_at_the_prediction_with_its_beam_on_both_planes(
    monkeypatch: pytest.MonkeyPatch, volume: Volume
) -> None:
    heights = np.linspace(0.0, 24.0, 25)
    curve = np.stack([np.full(25, -30.0), np.full(25, -34.0) + 0.1 * heights, heights], axis=1)
    mass = Volume(np.ones((3, 3, 3)), np.array([-31.0, -35.0, 1.0]), np.ones(3), "LPS")
    cut = LesionCut("mass", curve[12], curve)
    figure = figure_of(monkeypatch, [cut], VolumeLesions(volume, [cut], {"mass": mass}), ["mass"])
    axial, sagittal = (next(a for a in figure.axes if plane in a.get_title()) for plane in ("axial", "sagittal"))
    assert axial.get_title() == "R MR, axial, z = 12 mm"
    for axes, columns in ((axial, (0, 1)), (sagittal, (1, 2))):
        drawn = [line for line in axes.lines if line.get_linestyle() == ":"]
        np.testing.assert_allclose(np.array(drawn[0].get_data()).T, curve[:, columns])
        assert any(line.get_marker() == "x" for line in axes.lines)
    assert any("8 mm off" in text.get_text() for text in axial.texts)
    assert not any("off" in text.get_text() for text in sagittal.texts)
    assert "case1" in figure.get_suptitle()
    assert "depth not determined" in figure.get_suptitle()


def test_several_lesions_have_each_a_cut_a_colour_and_a_name(monkeypatch: pytest.MonkeyPatch, volume: Volume) -> None:
    places = {"mass": np.array([-30.0, -30.0, 12.0]), "cyst": np.array([-24.0, -40.0, 2.0])}
    cuts = [LesionCut(name, place) for name, place in places.items()]
    figure = figure_of(monkeypatch, cuts, VolumeLesions(volume, cuts), list(places))
    titles = [axes.get_title() for axes in figure.axes]
    assert [title for title in titles if "MR, axial" in title] == [
        "mass: R MR, axial, z = 12 mm",
        "cyst: R MR, axial, z = 2 mm",
    ]
    (legend,) = figure.legends
    keys = dict(zip([t.get_text() for t in legend.get_texts()], legend.get_lines(), strict=True))
    assert keys["mass"].get_color() != keys["cyst"].get_color()
    colours = LesionColours(list(places))
    assert colours.true("mass") == colours.predicted("mass") == keys["mass"].get_color()
    assert keys["as marked"].get_linestyle() != keys["predicted (updated)"].get_linestyle()


def test_a_lesion_beside_a_slice_is_known_by_its_distance_and_its_shadow() -> None:
    mask = Volume(np.ones((3, 3, 5)), np.array([0.0, 0.0, 10.0]), np.ones(3), "LPS")
    assert off_slice_mm(mask, "axial", np.array([0.0, 0.0, 4.5])) == 5.0
    assert off_slice_mm(mask, "axial", np.array([0.0, 0.0, 12.0])) == 0.0
    assert off_slice_mm(mask, "sagittal", np.array([4.5, 0.0, 0.0])) == 2.0
    axes = Figure().subplots()
    show_slice(
        axes, mask, "axial", np.array([0.0, 0.0, -500.0]), [SliceOverlay(shadow(mask, "axial"), TRUE_COLOUR)], ""
    )
    border = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    np.testing.assert_allclose(border.mean(axis=0), [1.0, 1.0], atol=0.2)


def test_no_coordinate_is_minus_zero() -> None:
    assert [whole_mm(value) for value in (-0.3, 0.2, -0.7, 12.4)] == ["0 mm", "0 mm", "-1 mm", "12 mm"]


# Machado, Oliveira and Fernandes (IEEE TVCG 2009), severity 1, on linear RGB.
DEFICIENCIES = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}


@pytest.mark.parametrize("deficiency", list(DEFICIENCIES))
@pytest.mark.parametrize(
    "together",
    [
        (TRUE_COLOUR, PREDICTED_COLOUR),
        (TRUE_COLOUR, METHOD_COLOURS["rigid"], METHOD_COLOURS["scaling"]),
        (TRUE_COLOUR, METHOD_COLOURS["plate"], METHOD_COLOURS["updated"]),
        (BREAST_COLOUR, GLAND_COLOUR, MESH_COLOUR),
        LESION_COLOURS[:4],
    ],
)
def test_colours_of_one_picture_differ_for_readers_without_red_or_green(
    together: tuple[str, ...], deficiency: str
) -> None:
    linear = np.array([to_rgba(colour)[:3] for colour in together]) ** 2.2
    seen = np.clip(linear @ np.array(DEFICIENCIES[deficiency]).T, 0.0, 1.0)
    lab = rgb2lab((seen ** (1 / 2.2))[None])[0]
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=-1)[np.triu_indices(len(lab), 1)]
    assert apart.min() > 30.0


def test_other_pictures_are_drawn_and_reproducible(image: DetectorImage, volume: Volume) -> None:
    rng = np.random.default_rng(0)
    theta = np.linspace(-1.4, 1.4, 40)
    outline = np.stack([50 * np.cos(theta), 40 * np.sin(theta)], axis=1)
    views = [ViewOutlines("CC", image, outline, np.ones(40), {"rigid": outline * 0.9, "updated": outline * np.nan})]
    pixels = rng.uniform(-20, 20, (5, 2))
    marks = [ViewLandmarks("CC", image, pixels, {"updated": np.where(pixels > 15, np.nan, pixels + 1)})]
    places = rng.uniform(-40, -20, (5, 3))
    grid = np.stack(np.meshgrid(*[np.linspace(0, 50, 3)] * 3, indexing="ij"), axis=-1)
    block = BlockMesh(2, grid.transpose(2, 1, 0, 3).reshape(-1, 3))
    squeezed = block.points * [1.2, 1.2, 0.6]
    plates = [PlatesPicture("CC", block.points, squeezed, block.skin_quads(), 0.0, 30.0, 50.0)]
    mask = volume.with_data(volume.data > 0)
    makers = [
        lambda: outlines_before_and_after(views, LEFT),
        lambda: landmarks_in_mammograms(marks, LEFT),
        lambda: landmarks_in_volume(mask, places, {"plate": places + 2}, RIGHT),
        lambda: deformed_meshes(plates, RIGHT),
        lambda: segmentation(volume, mask, mask, None, np.array([-30.0, -66.0, 12.0]), RIGHT),
        lambda: error_panels([ErrorPanel("Table V", {"rigid": [5.0, 7.0], "updated": []}, {"updated": 4.3})]),
        lambda: error_against_runtime([RuntimePoint("plate", "CC", n, 10 / n, n**2) for n in (5, 7, 10)]),
    ]
    for make in makers:
        picture = make()
        assert Image.open(io.BytesIO(picture.tobytes())).width > 200
        np.testing.assert_array_equal(picture, make())
