"""Frames of points and volumes: a step into the wrong one is an error, and there and back changes nothing."""

import numpy as np
import pytest

from mammoreg.geometry import Volume, breast_to_lps, lps_to_breast

POINTS = np.random.default_rng(3).normal(size=(20, 3)) * 50.0


@pytest.fixture
def volume() -> Volume:
    data = np.random.default_rng(4).normal(size=(5, 6, 7))
    return Volume(data, np.array([12.0, -80.0, 7.0]), np.array([1.5, 1.0, 2.0]), "LPS")


@pytest.mark.parametrize("side", ["L", "R"])
def test_points_go_there_and_back(side):
    breast = lps_to_breast(POINTS, side)
    np.testing.assert_array_equal(breast[:, 0], -POINTS[:, 0] if side == "L" else POINTS[:, 0])
    np.testing.assert_array_equal(breast_to_lps(breast, side), POINTS)


@pytest.mark.parametrize("side", ["L", "R"])
def test_volume_shows_the_same_tissue_at_the_same_place_in_both_frames(volume, side):
    breast = volume.to_breast(side)
    index = np.argwhere(np.ones(volume.shape))
    places = lps_to_breast(volume.to_world(index), side)
    np.testing.assert_allclose(breast.sample(places), volume.data.ravel(), rtol=1e-6)
    back = breast.to_lps(side)
    np.testing.assert_array_equal(back.data, volume.data)
    np.testing.assert_allclose(back.origin, volume.origin)
    assert (volume.frame, breast.frame, back.frame) == ("LPS", "breast", "LPS")


@pytest.mark.parametrize("side", ["L", "R"])
def test_double_flip_is_refused(volume, side):
    with pytest.raises(ValueError, match="breast frame is not one of the LPS frame"):
        volume.to_breast(side).to_breast(side)
    with pytest.raises(ValueError, match="LPS frame is not one of the breast frame"):
        volume.to_lps(side)
    with pytest.raises(ValueError, match="LPS frame is not one of the breast"):
        volume.with_data(volume.data > 0).to_lps(side)
