"""Whether mammogram and MR breast are of one size: flags and failures with numbers and causes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.pose.size import imaged_volume_ml
from stages.evaluate.size_doubts import ShownSize, size_doubts
from stages.pose.size import check_imaged_volume, check_size

VIEW = ViewGeometry(0.0, 0.0, 0.0, 0.0, 60.0, 650.0, 20.0, 0.2, 700, 400)


def _facts(view: ViewGeometry = VIEW) -> Any:
    """A view of 400 x 200 pixels of breast and as much muscle."""
    tissue = np.zeros((700, 400), np.uint8)
    tissue[100:500, :200], tissue[500:600, :200] = 1, 2
    return SimpleNamespace(seen=SimpleNamespace(geometry=view), tissue=tissue)


def _segment(ml: float) -> Any:
    mask = np.zeros((20, 20, 20), np.uint8)
    mask[5:15, 5:15, 5:15] = 1
    return SimpleNamespace(breast_mask=Volume(mask, np.zeros(3), np.full(3, ml ** (1 / 3))))


def test_volume_between_the_plates() -> None:
    """80 x 40 mm at the detector, 600 / 650 of it in the middle of the plates, 60 mm thick."""
    assert imaged_volume_ml(80_000, VIEW) == pytest.approx(80 * 40 * (600 / 650) ** 2 * 60 / 1000)


def test_sound_sizes_have_no_doubt() -> None:
    values, doubts = check_imaged_volume(_facts(), _segment(200.0))
    assert values == {"imaged_ml": pytest.approx(163.6, abs=0.1), "imaged_share": pytest.approx(0.818, abs=0.001)}
    assert doubts == ()
    assert check_size(1.05, VIEW) == ()


def test_an_unknown_thickness_tells_no_volume() -> None:
    assert check_imaged_volume(_facts(replace(VIEW, thickness_mm=float("nan"))), _segment(200.0)) == ({}, ())


@pytest.mark.parametrize("ml", [70.0, 450.0])
def test_odd_volumes_are_flagged_with_their_numbers(ml: float) -> None:
    (doubt,) = check_imaged_volume(_facts(), _segment(ml))[1]
    assert "the mammogram shows 164 ml (area x thickness, pixels of 0.2 mm, 60 mm thick)" in doubt
    assert f"a breast of {ml:.0f} ml" in doubt


@pytest.mark.parametrize(
    ("view", "says"),
    [
        (replace(VIEW, thickness_mm=6.0), r"not of one size; check pixel spacing, thickness.*in mm, not cm"),
        (replace(VIEW, pixel_mm=0.45), "check pixel spacing"),
        (replace(VIEW, pixel_mm=0.02), "check pixel spacing"),
    ],
)
def test_impossible_volumes_fail(view: ViewGeometry, says: str) -> None:
    with pytest.raises(DataError, match=says):
        check_imaged_volume(_facts(view), _segment(200.0))


def test_outlines_of_another_size_are_flagged_or_fail() -> None:
    (smaller,), (larger,) = check_size(1.25, VIEW), check_size(0.7, VIEW)
    assert smaller.startswith("the mammogram's breast is 20% smaller than the MR volume's between plates")
    assert larger.startswith("the mammogram's breast is 43% larger than")
    with pytest.raises(DataError, match=r"38% smaller .*\(pixels of 0.2 mm, plates 60 mm apart\); check pixel spacing"):
        check_size(1.6, VIEW)


def _both(sizes: tuple[float | None, ...], share: float | None = 0.9) -> list[str]:
    return size_doubts([ShownSize(size, share) for size in sizes])


def test_both_views_together_tell_more_than_one() -> None:
    assert _both((1.12, 1.14, None)) == [
        (
            "all mammograms show a breast 12% smaller than the MR volume's between plates: "
            "check their pixel spacing and thickness"
        )
    ]
    assert _both((0.8, 0.82))[0].startswith("all mammograms show a breast 23% larger")
    assert _both((0.95, 1.05)) == _both((1.12,)) == _both((None, 1.12)) == []


def test_a_small_outline_that_shows_little_of_the_breast_is_doubted() -> None:
    """Twin1 with its pixel spacing 15 % too small: the plates' edge moves forward and hides half of it."""
    wrong = [ShownSize(1.0696, 0.648), ShownSize(1.0687, 0.673)]
    (doubt,) = size_doubts(wrong)
    assert "a breast 6% smaller than the MR volume's between plates, and no more than 66% of its volume" in doubt
    smallest_of_the_sound = [ShownSize(1.025, 0.63), ShownSize(1.049, 0.78)]
    assert size_doubts(smallest_of_the_sound) == []
    assert _both((1.07, 1.07), share=0.95) == _both((1.07, 1.07), share=None) == _both((0.97, 0.97), share=0.5) == []
