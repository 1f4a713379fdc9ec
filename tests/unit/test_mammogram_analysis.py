"""Breast, outline, pectoral muscle and nipple in mammograms."""

import numpy as np
import pytest

from mammoreg.errors import DataError
from mammoreg.imaging.mammogram import analyse
from mammoreg.imaging.mammogram_canonical import canonicalise
from tests.unit.mammogram_images import (
    DEPTH_MM,
    HALF_HEIGHT_MM,
    MIDDLE_ROW,
    PIXEL_MM,
    SHAPE,
    breast_image,
    fading_skin,
    inside_share,
    with_glow,
    with_pectoral,
)


def _distance_to_ellipse_mm(outline):
    angle = np.linspace(-np.pi / 2, np.pi / 2, 4001)
    true = np.stack([DEPTH_MM * np.cos(angle), HALF_HEIGHT_MM * np.sin(angle)], axis=1)
    found = np.stack([(outline[:, 0] + 0.5) * PIXEL_MM, (outline[:, 1] - MIDDLE_ROW) * PIXEL_MM], axis=1)
    return np.linalg.norm(found[:, None] - true[None], axis=2).min(axis=1)


def test_outline_of_an_ellipse_is_found_below_a_pixel():
    found = analyse(breast_image(), PIXEL_MM, "CC")
    distance = _distance_to_ellipse_mm(found.outline[found.outline_weight >= 1.0])
    assert distance.mean() < 0.15
    assert distance.max() < 0.4


@pytest.mark.parametrize("reach_mm", [10.0, 25.0, 60.0])
def test_outline_does_not_run_through_glowing_air(reach_mm):
    found = analyse(with_glow(breast_image(), reach_mm), PIXEL_MM, "CC")
    assert _distance_to_ellipse_mm(found.outline[found.outline_weight >= 1.0]).max() < 0.6
    assert 0.2 < found.step < 1.0
    assert found.stepped_share == 1.0


def test_outline_of_skin_that_fades_into_the_air_lies_at_its_foot():
    found = analyse(fading_skin(), PIXEL_MM, "CC")
    assert _distance_to_ellipse_mm(found.outline[found.outline_weight >= 1.0]).max() < 0.6
    assert 0.01 < found.step < 0.05


def test_a_bright_column_of_the_detector_is_no_outline():
    image = breast_image(noise=0.0)
    image[:, 276] += 12.0
    found = analyse(image, PIXEL_MM, "CC")
    assert _distance_to_ellipse_mm(found.outline[found.outline_weight >= 1.0]).max() < 0.6


def test_edge_of_a_paddle_in_the_air_is_no_outline():
    image = breast_image(noise=1.0)
    image[60:600, :340] += 30.0
    found = analyse(image, PIXEL_MM, "CC")
    assert _distance_to_ellipse_mm(found.outline[found.outline_weight >= 1.0]).max() < 0.6


def test_breast_cut_at_the_anterior_edge_says_how_far_it_is_cut():
    cut = analyse(breast_image()[:, :277], PIXEL_MM, "CC")
    assert cut.cut_mm == pytest.approx(
        2.0 * HALF_HEIGHT_MM * np.sqrt(1.0 - (275.0 * PIXEL_MM / DEPTH_MM) ** 2), abs=2.5
    )
    assert cut.mask[[int(MIDDLE_ROW) - 100, int(MIDDLE_ROW) + 100], :150].all()
    assert cut.outline_weight[cut.outline[:, 0] > 270.0].max() < 0.3
    assert analyse(breast_image(), PIXEL_MM, "CC").cut_mm == 0.0


@pytest.mark.parametrize("dark", [False, True])
def test_breast_cut_so_far_that_no_edge_shows_air_is_refused(dark):
    cut = breast_image()[40:620, :230]
    with pytest.raises(DataError, match="cut at its anterior edge"):
        canonicalise(4095.0 - cut if dark else cut, "L", "CC")


def test_air_without_a_step_to_the_breast_is_refused():
    slope = (200.0 * np.exp(-3.0 * inside_share())).astype(np.float32)
    with pytest.raises(DataError, match="no grey step between breast and air"):
        analyse(slope, PIXEL_MM, "CC")


def test_breast_that_fills_the_image_is_refused():
    image = np.repeat(np.linspace(900.0, 600.0, 400)[None, :], 640, axis=0).astype(np.float32)
    image[:, -12:] = 40.0
    with pytest.raises(DataError, match="no part of its outline is skin|cropped too tightly"):
        analyse(image, PIXEL_MM, "CC")


def test_outline_runs_evenly_from_low_to_high_rows_and_fades_at_the_chest_wall():
    found = analyse(breast_image(), PIXEL_MM, "CC")
    assert found.outline[0, 1] < MIDDLE_ROW < found.outline[-1, 1]
    steps = np.linalg.norm(np.diff(found.outline, axis=0), axis=1) * PIXEL_MM
    assert steps == pytest.approx(1.0, abs=0.15)
    expected = np.clip(found.outline[:, 0] * PIXEL_MM / 10.0, 0.0, 1.0)
    assert found.outline_weight == pytest.approx(expected, abs=0.05)
    assert found.pectoral is None


def test_text_in_the_air_is_no_breast():
    mask = analyse(breast_image(), PIXEL_MM, "CC").mask
    true = inside_share() < 1.0
    assert not mask[20:40, 340:390].any()
    assert 2.0 * (mask & true).sum() / (mask.sum() + true.sum()) > 0.995


def test_result_does_not_depend_on_gain_and_offset_of_the_grey_values():
    image = breast_image()
    first, second = analyse(image, PIXEL_MM, "CC"), analyse(3.0 * image + 500.0, PIXEL_MM, "CC")
    assert first.outline == pytest.approx(second.outline, abs=1e-2)


def test_finer_pixels_give_the_same_outline_in_mm():
    coarse = analyse(breast_image(), PIXEL_MM, "CC")
    fine = analyse(np.repeat(np.repeat(breast_image(), 3, axis=0), 3, axis=1), PIXEL_MM / 3.0, "CC")
    back = (fine.outline + 0.5) / 3.0 - 0.5
    nearest = np.linalg.norm(back[:, None] - coarse.outline[None], axis=2).min(axis=1) * PIXEL_MM
    assert np.percentile(nearest, 95) < 0.6
    assert fine.mask.shape == (3 * SHAPE[0], 3 * SHAPE[1])


def test_pectoral_muscle_is_found_in_mlo_and_takes_the_weight_there():
    found = analyse(with_pectoral(breast_image()), PIXEL_MM, "MLO")
    row, column = np.indices(SHAPE)
    true = (column / 130.0 + (row - 120.0) / 280.0 < 1.0) & (inside_share() < 1.0)
    assert found.pectoral is not None
    assert 2.0 * (found.pectoral & true).sum() / (found.pectoral.sum() + true.sum()) > 0.9
    upper = found.outline[:, 1] < 120.0
    assert found.outline_weight[upper].max() < 1.0
    assert (found.outline_weight[~upper] == 1.0).any()


def test_muscle_in_the_inferior_corner_alone_tells_that_rows_may_run_the_other_way():
    hung = with_pectoral(breast_image())
    assert not analyse(hung, PIXEL_MM, "MLO").muscle_below
    turned = analyse(np.ascontiguousarray(hung[::-1]), PIXEL_MM, "MLO")
    assert turned.pectoral is None
    assert turned.muscle_below
    assert not analyse(breast_image(), PIXEL_MM, "MLO").muscle_below
    assert not analyse(np.ascontiguousarray(hung[::-1]), PIXEL_MM, "CC").muscle_below


def test_mlo_without_pectoral_muscle_finds_none():
    assert analyse(breast_image(), PIXEL_MM, "MLO").pectoral is None


def test_nipple_in_profile_is_found_and_a_smooth_outline_has_none():
    image = breast_image()
    assert analyse(image, PIXEL_MM, "CC").nipple is None
    row, column = np.indices(SHAPE)
    tip = np.hypot(column - DEPTH_MM / PIXEL_MM, row - MIDDLE_ROW - 20.0) * PIXEL_MM < 4.5
    nipple = analyse(np.where(tip, 600.0, image), PIXEL_MM, "CC").nipple
    assert nipple is not None
    assert np.hypot(*(nipple - [DEPTH_MM / PIXEL_MM + 16.0, MIDDLE_ROW + 20.0])) * PIXEL_MM < 2.5


def test_breast_away_from_the_chest_wall_is_refused():
    image = np.roll(breast_image(), 150, axis=1)
    image[:, :150] = 40.0
    with pytest.raises(DataError, match="chest-wall edge"):
        analyse(image, PIXEL_MM, "CC")


def test_region_smaller_than_a_breast_is_refused():
    image = np.random.default_rng(0).normal(20.0, 2.0, (400, 300))
    image[100:200, :50] = 500.0
    with pytest.raises(DataError, match="no breast"):
        analyse(image, PIXEL_MM, "CC")
