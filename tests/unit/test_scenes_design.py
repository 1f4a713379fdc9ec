"""The design of the stability study: what the issue asks of it, and that it stays what was committed."""

import hashlib
from collections import Counter

import pytest

from mammoreg.scenes.design import all_level_pairs, is_worst_corner, level_pairs, stability_design
from mammoreg.scenes.scenario import LEVELS, SCAN, alike_but

COMMITTED = "34e9d9e00ef2203293f6dbae55cf2efdab0dee819a4802013a04cb7f8c65a328"


@pytest.fixture(scope="module")
def design():
    return stability_design()


def test_design_is_that_which_was_committed(design):
    text = "\n".join(f"{s.name} {s.levels}" for s in design)
    assert hashlib.sha256(text.encode()).hexdigest() == COMMITTED


def test_another_seed_is_another_design_with_the_same_corners(design):
    other = stability_design(7)
    assert [s for s in other if s.name.startswith("corner")] == [s for s in design if s.name.startswith("corner")]
    assert other != design
    assert other == stability_design(7)


def test_at_least_200_scenarios_run_with_and_without_the_scan(design):
    assert len(design) == 240
    assert sum(s.shape != SCAN for s in design) >= 200


def test_names_and_scenarios_are_unique(design):
    assert len({s.name for s in design}) == len({s.levels for s in design}) == len(design)


@pytest.mark.parametrize("factor", LEVELS)
def test_every_level_stands_at_least_15_times(design, factor):
    counts = Counter(getattr(s, factor) for s in design)
    assert set(counts) == set(LEVELS[factor])
    assert min(counts.values()) >= 15


def test_every_pair_of_levels_stands_at_least_once(design):
    assert set().union(*map(level_pairs, design)) == all_level_pairs()


def test_every_level_meets_the_scan(design):
    of_the_scan = [s for s in design if s.shape == SCAN]
    for factor, levels in LEVELS.items():
        if factor != "shape":
            assert {getattr(s, factor) for s in of_the_scan} == set(levels)


def test_16_worst_corners_over_all_laws_meshes_shapes_and_frictions(design):
    worst = [s for s in design if is_worst_corner(s) and s.name.startswith("corner")]
    assert len(worst) == 16
    for factor in ("material", "elements"):
        assert {getattr(s, factor) for s in worst} == set(LEVELS[factor])
    assert {(s.shape, s.friction > 1.0) for s in worst} == {
        (a, b) for a in ("pendulous", "flat") for b in (False, True)
    }


def test_pairs_for_the_ratio_of_iterations(design):
    pairs = [g for g in alike_but(design, "poisson") if {0.49, 0.4999} <= {s.poisson for s in g}]
    assert len(pairs) >= 48


def test_groups_for_the_trend_with_the_mesh(design):
    groups = [g for g in alike_but(design, "elements") if [s.elements for s in g] == list(LEVELS["elements"])]
    assert len(groups) >= 6
    assert {g[0].compression for g in groups} >= {0.21, 0.35, 0.5}
