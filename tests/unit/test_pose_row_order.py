"""Which of two row orders is taken, by the misfits of their poses and the pectoral muscle."""

from types import SimpleNamespace

import numpy as np
import pytest

from mammoreg.errors import DataError, NotConvergedError
from mammoreg.imaging.mammogram_orientation import Flips
from mammoreg.pose.row_order import DECISIVE, ORDER_ASSUMED, pose_in_order


def _order(rows, misfit, muscle=False, columns=True):
    found = SimpleNamespace(pectoral=np.ones((2, 2), dtype=bool) if muscle else None)
    return SimpleNamespace(view=misfit, found=found, image=SimpleNamespace(flips=Flips(rows, columns)))


def _find(misfit):
    if isinstance(misfit, Exception):
        raise misfit
    return SimpleNamespace(
        estimate=SimpleNamespace(candidates=[SimpleNamespace(misfit=m) for m in (misfit + 9, misfit)])
    )


@pytest.mark.parametrize(
    ("usual", "turned", "chosen"), [(0.0, 7.0, 0), (7.0, 0.0, 1), (NotConvergedError("no"), 3.0, 1)]
)
def test_the_order_that_fits_far_better_is_taken_without_a_doubt(usual, turned, chosen):
    got = pose_in_order([_order(False, usual), _order(True, turned)], _find, "R", "MLO")
    assert (got.chosen, got.doubts) == (chosen, ())


def test_a_muscle_in_the_upper_corner_of_one_order_decides_where_the_fit_does_not():
    got = pose_in_order([_order(False, 0.0), _order(True, 0.0, muscle=True)], _find, "R", "MLO")
    assert (got.chosen, got.doubts) == (1, ())


def test_two_orders_that_fit_alike_are_as_usual_with_a_doubt_where_the_chest_wall_lies_as_usual():
    orders = [_order(False, 0.5 * DECISIVE), _order(True, 0.0)]
    got = pose_in_order(orders, _find, "R", "MLO")
    assert (got.chosen, got.doubts) == (0, (ORDER_ASSUMED,))
    with pytest.raises(DataError, match="column 'orientation'") as caught:
        pose_in_order(orders, _find, "L", "MLO")
    assert r"with P\FR if it is mirrored" in str(caught.value)
    assert r"P\HL if it is turned" in str(caught.value)


def test_a_breast_that_fits_in_neither_order_fails_as_in_the_usual_one():
    with pytest.raises(DataError, match="first"):
        pose_in_order([_order(False, DataError("first")), _order(True, DataError("second"))], _find, "R", "CC")


@pytest.mark.parametrize(("view", "usual", "other"), [("LM", r"P\F", r"P\H"), ("FB", r"P\L", r"P\R")])
def test_a_view_that_is_stored_either_way_is_asked_for_where_nothing_decides(view, usual, other):
    with pytest.raises(DataError, match=f"a {view} is stored either way") as caught:
        pose_in_order([_order(True, 1.0), _order(False, 0.0)], _find, "R", view)
    assert f"with {usual} or {other}" in str(caught.value)
    assert pose_in_order([_order(True, 9.0), _order(False, 0.0)], _find, "R", view).chosen == 1
