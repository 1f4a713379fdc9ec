"""What is no breast as a scanner shows it is refused or doubted; breasts are neither."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging import anatomy
from mammoreg.imaging.mr_checks import Check, check_field_of_view, doubts, share_below_air
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, no_bias, segment_volume
from tests.unit.torso_phantom import LEFT, RIGHT, Breast, torso

SETTINGS = SegmentSettings(spacing_mm=2.0)
NOISE = 6.0


def segmented(volume: Volume) -> Segmentation:
    return segment_volume(volume, None, SETTINGS, no_bias)


def value(found: Segmentation, name: str) -> float:
    (check,) = (check for check in found.checks if check.name == name)
    assert check.value is not None
    return check.value


def subtraction() -> Volume:
    """After less before contrast agent: gland and muscle are brighter by half, fat by a fiftieth; both have noise."""
    before = torso(noise=0.0)
    random = np.random.default_rng(3)
    enhanced = np.where(before.data > 250.0, 0.5, 0.02) * before.data
    noisy = [
        np.hypot(signal + random.normal(0.0, NOISE, signal.shape), random.normal(0.0, NOISE, signal.shape))
        for signal in (before.data + enhanced, before.data)
    ]
    return before.with_data((noisy[0] - noisy[1]).astype(np.float32))


def rotating_projection() -> Volume:
    """Maximum intensity projections from directions around the body, one a slice."""
    data = torso(spacing=3.0).data
    angles = np.linspace(0.0, 180.0, 24, endpoint=False)
    shown = [ndimage.rotate(data, angle, axes=(0, 1), reshape=False, order=1).max(axis=1) for angle in angles]
    return Volume(np.stack(shown, axis=1), np.array([-140.0, -45.0, -90.0]), np.array([3.0, 7.0, 3.0]))


@pytest.mark.parametrize("noise", [3.0, 6.0, 15.0])
@pytest.mark.parametrize("fat_suppressed", [True, False], ids=["fat-suppressed", "fat bright"])
def test_a_breast_is_not_doubted(fat_suppressed: bool, noise: float) -> None:
    found = segmented(torso(fat_suppressed=fat_suppressed, noise=noise))
    assert doubts(found.checks) == ""
    a, depth, c = RIGHT.axes
    assert value(found, anatomy.VOLUME) == pytest.approx(2.0 / 3.0 * np.pi * a * depth * c / 1000.0, rel=0.2)
    assert value(found, anatomy.SKIN) == pytest.approx(1.8, abs=2.0)
    assert value(found, anatomy.HEIGHTS) == pytest.approx(LEFT.axes[1] / RIGHT.axes[1], abs=0.1)
    assert value(found, anatomy.CUT) == 0.0


@pytest.mark.parametrize(
    "kept",
    [lambda data: data, lambda data: np.maximum(data, 0.0), np.abs, lambda data: data + 1000.0],
    ids=["signed", "clipped", "magnitude", "offset"],
)
def test_a_subtraction_is_refused(kept: object) -> None:
    volume = subtraction()
    assert callable(kept)
    with pytest.raises(DataError, match=r"subtraction|no breast"):
        segmented(volume.with_data(kept(volume.data)))


def test_a_subtraction_with_slices_missing_is_refused() -> None:
    volume = subtraction()
    slices = np.sort(np.random.default_rng(1).choice(volume.shape[2], volume.shape[2] // 3, replace=False))
    with pytest.raises(DataError):
        segmented(Volume(np.maximum(volume.data[:, :, slices], 0.0), volume.origin, volume.spacing))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("smooth_voxels", [0.0, 1.5, 4.0])
def test_noise_is_refused(seed: int, smooth_voxels: float) -> None:
    volume = torso()
    noise = np.abs(ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=volume.shape), smooth_voxels))
    with pytest.raises(DataError):
        segmented(volume.with_data((1000.0 * noise / noise.max()).astype(np.float32)))


def test_a_projection_is_refused() -> None:
    with pytest.raises(DataError):
        segmented(rotating_projection())


def test_a_breast_beyond_the_volume_is_doubted() -> None:
    whole = torso()
    part = slice(int((whole.shape[2]) * 0.4), int(whole.shape[2] * 0.72))
    origin = whole.to_world(np.array([0, 0, part.start]))
    found = segmented(Volume(np.ascontiguousarray(whole.data[:, :, part]), origin, whole.spacing))
    assert "end of the volume" in doubts(found.checks)


def test_a_much_smaller_other_breast_is_doubted() -> None:
    found = segmented(torso((RIGHT, Breast(LEFT.centre, (30.0, 24.0, 40.0)))))
    assert "other breast" in doubts(found.checks)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_a_volume_of_impossible_size_is_refused(axis: int, factor: float) -> None:
    volume = torso(spacing=4.0)
    spacing = volume.spacing.copy()
    spacing[axis] *= factor
    with pytest.raises(DataError, match="voxel spacing"):
        check_field_of_view(replace(volume, spacing=spacing))


def test_magnitudes_with_their_mean_taken_away_lie_not_below_air() -> None:
    """As normalised for learning; a difference of two volumes has values far below the level of air."""
    volume = torso()
    normalised = volume.with_data((volume.data - volume.data.mean()) / volume.data.std())
    assert share_below_air(normalised) < 0.001
    assert share_below_air(subtraction()) > 0.01


def test_ringing_of_interpolation_is_no_subtraction() -> None:
    volume = torso(spacing=4.0)
    fine = ndimage.zoom(volume.data, 2.0, order=3)
    assert fine.min() < -20.0
    check_field_of_view(Volume(fine, volume.origin, 0.5 * volume.spacing))


def test_every_range_has_its_source_and_its_limits_in_order() -> None:
    for usual in (*anatomy.RANGES.values(), anatomy.FIELD_OF_VIEW):
        assert usual.source
        assert usual.least <= usual.low <= usual.high <= usual.most


def test_doubt_names_value_and_what_is_usual() -> None:
    check = Check(anatomy.VOLUME, 20.0)
    assert check.doubt == "volume of the breast is 20 ml, usual is 55 to 4777 ml"
    assert not check.refused
    assert Check(anatomy.VOLUME, 5.0).refused
    assert Check(anatomy.HEIGHTS, None).doubt == ""
