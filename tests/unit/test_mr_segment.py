"""Segmentation of MR volumes on a torso of known shape and on real data."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, segment_body, segment_volume
from tests.unit.torso_phantom import CHEST_P, LEFT, RIGHT, torso

SETTINGS = SegmentSettings(spacing_mm=2.0)


def voxel_centres(grid: Volume) -> NDArray[np.float64]:
    return grid.to_world(np.moveaxis(np.indices(grid.shape), 0, -1))


def no_bias(volume: Volume, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    return np.ones(volume.shape, np.float32)


@pytest.fixture(scope="module", params=[True, False], ids=["fat-suppressed", "fat bright"])
def right(request: pytest.FixtureRequest) -> tuple[Segmentation, bool]:
    return segment_volume(torso(fat_suppressed=request.param), None, SETTINGS, no_bias), request.param


def test_contrast_is_recognised_from_the_image(right: tuple[Segmentation, bool]) -> None:
    found, suppressed = right
    assert found.fat_suppressed is suppressed


def test_breast_is_the_ellipsoid_in_front_of_its_back(right: tuple[Segmentation, bool]) -> None:
    found, _ = right
    points = voxel_centres(found.mr)
    p, radius = points[..., 1], RIGHT.radius(points)
    front = p < CHEST_P - 35.0
    expected, given = (radius < 1.0) & front, found.breast & front
    assert 2.0 * (expected & given).sum() / (expected.sum() + given.sum()) > 0.97
    assert not (found.breast & (p > CHEST_P + 15.0)).any()
    assert not (found.breast & (radius > 1.25)).any()


def test_back_is_in_front_of_the_muscle_and_behind_the_gland(right: tuple[Segmentation, bool]) -> None:
    found, _ = right
    centre = np.hypot(found.back[:, 0] - RIGHT.centre[0], found.back[:, 2] - RIGHT.centre[1]) < 15.0
    muscle_p, gland_p = CHEST_P + 0.002 * 50.0**2 + 14.0, CHEST_P - 12.0
    assert np.all(found.back[centre, 1] < muscle_p)
    assert np.all(found.back[centre, 1] > gland_p)


def test_back_bounds_the_mask(right: tuple[Segmentation, bool]) -> None:
    found, _ = right
    mask = found.mr.with_data(found.breast.astype(np.float32))
    step = np.array([0.0, found.mr.spacing[1], 0.0])
    assert mask.sample(found.back - step, order=0).mean() > 0.95
    assert mask.sample(found.back + step, order=0).mean() < 0.05


def test_nipple_is_found_to_a_few_millimetres(right: tuple[Segmentation, bool]) -> None:
    found, _ = right
    assert np.linalg.norm(found.nipple - RIGHT.nipple_point()) < 7.5
    assert np.hypot(*(found.nipple - RIGHT.nipple_point())[[0, 2]]) < 4.0


def test_gland_is_separated_from_fat(right: tuple[Segmentation, bool]) -> None:
    found, _ = right
    points = voxel_centres(found.mr)
    p, radius = points[..., 1], RIGHT.radius(points)
    ahead = found.breast & (p < CHEST_P - 15.0)
    assert (found.labels[ahead & (radius < 0.55)] == 2).mean() > 0.97
    assert (found.labels[ahead & (radius > 0.65) & (radius < 0.85)] == 1).mean() > 0.97


def test_mask_is_one_piece_and_labels_cover_it(right: tuple[Segmentation, bool]) -> None:
    from scipy import ndimage

    found, _ = right
    assert ndimage.label(found.breast)[1] == 1
    assert set(np.unique(found.labels[found.breast])) == {1, 2, 3}
    assert set(np.unique(found.labels[~found.breast])) == {0, 4}


def test_side_decides_between_two_breasts() -> None:
    found = segment_volume(torso().to_breast("L"), None, SETTINGS, no_bias)
    tip = LEFT.nipple_point() * np.array([-1.0, 1.0, 1.0])
    assert np.hypot(*(found.nipple - tip)[[0, 2]]) < 4.0


def test_half_a_volume_gives_the_same_breast() -> None:
    whole = segment_volume(torso(), None, SETTINGS, no_bias)
    half = segment_volume(torso(x_range=(-140.0, 10.0)), None, SETTINGS, no_bias)
    assert abs(int(half.breast.sum()) / int(whole.breast.sum()) - 1.0) < 0.05
    assert np.linalg.norm(half.nipple - whole.nipple) < 3.0


def test_given_labels_replace_the_automatic_ones() -> None:
    volume = torso()
    automatic = segment_volume(volume, None, SETTINGS, no_bias)
    labels = np.where(volume.data > 70.0, 1, 0).astype(np.uint8)
    labels[(np.linalg.norm(voxel_centres(volume) - [-70.0, 20.0, -5.0], axis=-1) < 10.0)] = 2
    found = segment_volume(volume, volume.with_data(labels), SETTINGS, no_bias)
    assert (found.labels == 2).sum() * found.mr.voxel_mm3 == pytest.approx(4.0 / 3.0 * np.pi * 1000.0, rel=0.05)
    assert abs(int(found.breast.sum()) / int(automatic.breast.sum()) - 1.0) < 0.1


@pytest.mark.parametrize("end", [CHEST_P - 1.0, CHEST_P + 24.0], ids=["no chest", "muscle slab"])
def test_breast_without_torso_ends_at_the_muscle_or_with_the_volume(end: float) -> None:
    """As in volumes of one breast cut at the chest: nothing but the breast has a corner with the torso."""
    whole = torso((RIGHT,), x_range=(-125.0, -15.0))
    points = voxel_centres(whole)
    p, beside = points[..., 1], RIGHT.radius(points) > 1.0
    data = np.where(beside, np.minimum(whole.data, 5.0), whole.data)
    data[(p > CHEST_P + 8.0) & ~beside] = 330.0
    count = int((end - whole.origin[1]) / whole.spacing[1]) + 1
    found = segment_volume(Volume(data[:, :count], whole.origin, whole.spacing), None, SETTINGS, no_bias)
    back = np.median(found.back[:, 1])
    assert min(end, CHEST_P + 8.0) - 7.0 < back < min(end, CHEST_P + 8.0) + 2.5


def test_body_of_a_second_volume_includes_the_chest() -> None:
    mask = segment_body(torso(fat_suppressed=False), 2.0)
    places = np.array([[-70.0, 20.0, 0.0], [-70.0, 80.0, 0.0], [-70.0, -40.0, 0.0]])
    assert mask.sample(places, order=0).tolist() == [1, 1, 0]


def test_a_ghost_beside_one_breast_is_not_taken_for_the_other() -> None:
    """Lateral noise and arms rise as a low hill beside the breast."""
    volume = torso((RIGHT,), x_range=(-140.0, 20.0))
    points = voxel_centres(volume)
    hill = (points[..., 0] < -118.0) & (points[..., 1] > CHEST_P - 5.0)
    found = segment_volume(volume.with_data(np.where(hill, 100.0, volume.data)), None, SETTINGS, no_bias)
    assert np.linalg.norm(found.nipple - RIGHT.nipple_point()) < 7.5


def test_the_other_breast_alone_is_refused() -> None:
    with pytest.raises(DataError, match="other side"):
        segment_volume(torso((LEFT,)), None, SETTINGS, no_bias)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda data: np.where(np.arange(data.size).reshape(data.shape) == 1000, np.nan, data), "not finite"),
        (lambda data: np.full_like(data, 7.0), "constant"),
        (lambda data: np.zeros_like(data), "constant"),
        (lambda data: np.random.default_rng(0).rayleigh(10.0, data.shape).astype(np.float32), "no b"),
    ],
    ids=["NaN", "constant", "empty", "noise"],
)
def test_unusable_volumes_are_refused(spoil: object, message: str) -> None:
    volume = torso()
    assert callable(spoil)
    with pytest.raises(DataError, match=message):
        segment_volume(volume.with_data(spoil(volume.data)), None, SETTINGS, no_bias)


def test_a_flat_chest_has_no_breast() -> None:
    with pytest.raises(DataError, match="no breast|stands only"):
        segment_volume(torso(()), None, SETTINGS, no_bias)
