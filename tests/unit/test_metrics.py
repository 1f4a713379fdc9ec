"""Measures against closed forms, and the paper's tables against the reference data."""

import json
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.localization.lesions import LesionArea, MaskLesion, SphereLesion, area_from_disc
from mammoreg.metrics.distances import detector_distance_mm, distance_to_curve_mm
from mammoreg.metrics.elongation import extents_mm
from mammoreg.metrics.overlap import overlap_of_areas, overlap_of_sizes, overlap_of_volumes
from mammoreg.metrics.paper import (
    BEFORE,
    METHODS,
    TABLE_2,
    TABLE_3,
    TABLE_4,
    TABLE_5,
    TABLE_6,
    PaperRow,
    paper_overlap_percent,
    paper_summary,
)
from mammoreg.metrics.summary import Summary, summarise
from tests.shared_data import DATA, requires_shared

GEOMETRY = ViewGeometry(0.0, 0.0, 0.0, -30.0, 60.0, 650.0, 15.0, 0.1, 900, 600)


def block(first: tuple[int, int], size: int = 10) -> LesionArea:
    return LesionArea(np.ones((size, size), dtype=bool), first)


def test_areas_that_share_a_quarter() -> None:
    found = overlap_of_areas(block((0, 0)), block((5, 5)))
    assert (found.overlap_percent, found.dice, found.size_ratio) == (25.0, 0.25, 1.0)


def test_coverage_is_not_dice() -> None:
    found = overlap_of_areas(block((0, 0), 20), block((5, 5)))
    assert found.overlap_percent == 100.0
    assert found.dice == pytest.approx(0.4)
    assert found.size_ratio == 4.0


def test_nothing_predicted_overlaps_nothing() -> None:
    assert overlap_of_areas(None, block((0, 0))).overlap_percent == 0.0
    assert overlap_of_volumes(None, SphereLesion(np.zeros(3), 8.0)).dice == 0.0


@given(st.integers(-12, 12), st.integers(-12, 12))
def test_dice_is_symmetric(dx: int, dy: int) -> None:
    one, other = area_from_disc(20.0, 20.0, 11.0), area_from_disc(20.3 + dx, 20.6 + dy, 8.0)
    assert overlap_of_areas(one, other).dice == pytest.approx(overlap_of_areas(other, one).dice)


def test_an_empty_truth_is_refused() -> None:
    with pytest.raises(ValueError, match="empty"):
        overlap_of_sizes(3.0, 0.0, 0.0)


def cube(side_mm: float, spacing: float, centre: np.ndarray) -> Volume:
    n = round(side_mm / spacing)
    origin = centre - 0.5 * side_mm + 0.5 * spacing
    return Volume(np.ones((n, n, n), dtype=bool), origin, np.full(3, spacing))


def test_volumes_on_different_grids() -> None:
    fine, coarse = cube(8.0, 0.5, np.array([4.0, 0.0, 0.0])), cube(8.0, 2.0, np.zeros(3))
    found = overlap_of_volumes(fine, MaskLesion(coarse))
    assert found.overlap_percent == pytest.approx(50.0)
    assert found.dice == pytest.approx(0.5)
    assert found.size_ratio == pytest.approx(1.0)
    far = overlap_of_volumes(cube(8.0, 0.5, np.full(3, 100.0)), MaskLesion(coarse))
    assert far.overlap_percent == 0.0


def test_cube_around_a_sphere() -> None:
    found = overlap_of_volumes(cube(10.0, 0.25, np.zeros(3)), SphereLesion(np.zeros(3), 10.0))
    assert found.overlap_percent == pytest.approx(100.0, abs=1.0)
    assert found.size_ratio == pytest.approx(6 / np.pi, rel=1e-6)


def test_detector_distances_are_divided_by_the_middle_magnification() -> None:
    magnification = 650.0 / (650.0 - 15.0 - 30.0)
    distance = detector_distance_mm(np.array([[30.0, 40.0]]), np.zeros((1, 2)), GEOMETRY)
    assert distance[0] == pytest.approx(5.0 / magnification)


def test_distance_to_a_curve() -> None:
    curve = np.stack([np.zeros(101), np.zeros(101), np.linspace(0, 50, 101)], axis=1)
    assert distance_to_curve_mm(np.array([3.0, 4.0, 20.0]), curve) == pytest.approx(5.0)


def test_summary_counts_what_is_missing() -> None:
    summary = summarise([1.0, None, 5.0, 6.0], [2.0, 8.0, 10.0, None])
    assert (summary.n, summary.of) == (3, 4)
    assert summary.mean_mm == pytest.approx(4.0)
    assert summary.sd_mm == pytest.approx(np.sqrt(14.0 / 3.0))
    assert summary.median_mm == 5.0
    assert summary.max_mm == 6.0
    assert summary.within_5_mm_percent == pytest.approx(200.0 / 3.0)
    assert summary.improvement_percent == pytest.approx(50.0)
    assert summary.reduction_percent == pytest.approx(50.0)
    assert summary.compared == 2


def test_a_lucky_hit_of_rigid_rules_the_mean_of_ratios_alone() -> None:
    summary = summarise([2.0, 2.0, 2.0, 2.0], [0.2, 10.0, 10.0, 0.0])
    assert summary.improvement_percent == pytest.approx(100 * (1 - (10.0 + 0.2 + 0.2) / 3))
    assert summary.reduction_percent == pytest.approx(100 * (1 - 2.0 / 5.05))
    assert summary.compared == 4


def test_without_any_rigid_prediction_nothing_is_compared() -> None:
    summary = summarise([2.0, 3.0], [None, None])
    assert (summary.improvement_percent, summary.reduction_percent, summary.compared) == (None, None, 0)


def test_summary_of_nothing() -> None:
    assert summarise([None, None]).mean_mm is None
    assert (summarise([None, None]).n, summarise([None, None]).of) == (0, 2)
    assert summarise([]).of == 0


def half_ellipse(forward: float, along: float) -> tuple[np.ndarray, np.ndarray]:
    theta = np.radians(np.linspace(-89, 89, 357))
    radius = 1.0 / np.hypot(np.cos(theta) / forward, np.sin(theta) / along)
    return np.stack([radius * np.cos(theta), radius * np.sin(theta)], axis=1), theta


def test_extents_of_a_half_ellipse() -> None:
    points, theta = half_ellipse(70.0, 50.0)
    found = extents_mm(points, theta, np.ones(len(theta)))
    assert found["lateral"] == pytest.approx(100.0, rel=1e-3)
    assert found["antero_posterior"] == pytest.approx(70.0, rel=1e-4)


def test_an_outline_without_one_side_has_no_width() -> None:
    points, theta = half_ellipse(70.0, 50.0)
    found = extents_mm(points, theta, (theta < 0.5).astype(float))
    assert found["lateral"] is None
    assert found["antero_posterior"] == pytest.approx(70.0, rel=1e-4)


REFERENCE = DATA / "reference" / "paper_tables.json"


@requires_shared("reference")
@pytest.mark.parametrize(("table", "rows"), [("table_5", TABLE_5), ("table_6", TABLE_6)])
def test_paper_tables_equal_the_reference(table: str, rows: tuple[PaperRow, ...]) -> None:
    reference = json.loads(REFERENCE.read_text())
    printed = reference[table]["rows"]
    assert [row["data_set"] for row in printed] == [row.data_set for row in rows]
    for method in METHODS:
        assert [(row[f"{method}_mm"], row[f"{method}_overlap"]) for row in printed] == [r.of(method) for r in rows]
        computed = reference["computed_from_tables"][table][method]
        summary = paper_summary(rows, method)
        assert summary.mean_mm == pytest.approx(computed["mean_mm"], abs=6e-4)
        assert summary.sd_mm == pytest.approx(computed["population_sd_mm"], abs=6e-4)
        assert paper_overlap_percent(rows, method) == pytest.approx(computed["mean_overlap_percent"], abs=6e-3)
    if table == "table_5":
        assert [row["view"] == "CC" for row in printed] == [row.view == "CC" for row in rows]
    else:
        assert [row["estimate_from_one_view"] for row in printed] == [row.view == "CC" for row in rows]


@requires_shared("reference")
@pytest.mark.parametrize(("name", "table"), [("table_2", TABLE_2), ("table_3", TABLE_3)])
def test_volunteer_equals_the_reference(name: str, table: Mapping[str, Summary]) -> None:
    printed = json.loads(REFERENCE.read_text())[name]
    for key in ("mean", "sd", "max"):
        assert printed[key] == [getattr(summary, f"{key}_mm") for summary in table.values()]
    firsts = [column.split()[0].lower() for column in printed["columns"]]
    assert firsts == [method.split("_")[0] for method in table]
    if name == "table_2":
        assert printed["before_simulation"] == {"mean": BEFORE.mean_mm, "max": BEFORE.max_mm}
        assert {summary.n for summary in table.values()} == {printed["landmarks"]}


@requires_shared("reference")
def test_skins_equal_the_reference() -> None:
    printed = json.loads(REFERENCE.read_text())["table_4"]
    assert [column.lower() for column in printed["columns"]] == [name.replace("none", "no skin") for name in TABLE_4]
    for number, kind in enumerate(("euclidean", "lateral")):
        assert printed[f"{kind}_mean"] == [both[number].mean_mm for both in TABLE_4.values()]
        assert printed[f"{kind}_max"] == [both[number].max_mm for both in TABLE_4.values()]


def test_the_papers_improvements_and_share() -> None:
    mammogram, mr = paper_summary(TABLE_5, "updated"), paper_summary(TABLE_6, "updated")
    assert mammogram.improvement_percent == pytest.approx(78.0, abs=0.5)
    assert mr.improvement_percent == pytest.approx(94.0, abs=0.5)
    assert mammogram.within_5_mm_percent == pytest.approx(100 * 9 / 11)
    assert mr.within_5_mm_percent == pytest.approx(100 * 4 / 6)
