"""Marks of both sides that do not lead to each other."""

from stages.evaluate.mark_doubts import mark_doubts
from tests.stages import synthetic_case as synthetic
from tests.stages.test_evaluate import evaluated
from tests.stages.test_localize import mr_marks, view_marks, write_tsv


def row(mm, method="updated", **where):
    return {"method": method, "name": "lesion", "distance_mm": mm, **where}


def test_only_what_is_too_far_counts_and_only_of_the_method_to_believe():
    flat = [row(12.0, view="CC"), row(8.0, view="MLO"), row(15.0, "rigid", view="CC"), row(None, view="CC")]
    (doubt,) = mark_doubts(flat, [], 10.0)
    assert doubt.startswith("CC: lesion is marked 12 mm from")
    assert mark_doubts(flat, [], 13.0) == []


def test_in_mr_a_single_view_s_point_does_not_count_for_it_is_half_a_guess():
    assert mark_doubts([], [row(30.0, views="CC")], 10.0) == []
    (doubt,) = mark_doubts([], [row(30.0, views="CC+MLO")], 10.0)
    assert doubt.startswith("CC+MLO: lesion is marked 30 mm")


def test_a_lesion_marked_elsewhere_is_remarked_and_neither_steers_nor_is_known_to_trust(tmp_path):
    inputs = synthetic.write_case(tmp_path)
    marks = mr_marks(tmp_path, "R") | view_marks(tmp_path, ("CC", "MLO"), (False, False))
    sound = evaluated(tmp_path, inputs | marks)
    assert sound.value("warnings") == []
    elsewhere = {"mass": [150.0, 250.0, 10.0]}
    marks["lesion_CC"] = write_tsv(tmp_path / "elsewhere.tsv", "name column row diameter_mm", elsewhere)
    moved = evaluated(tmp_path, inputs | marks)
    assert any(text.startswith("CC: mass is marked") for text in moved.value("warnings"))
    assert not any("is marked" in view["trust"] for view in moved.value("view_rows"))
    (place,) = [r for r in moved.value("table_5_rows") if r["view"] == "CC" and r["method"] == "updated"]
    assert place["distance_mm"] > 10.0
