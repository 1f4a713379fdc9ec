"""The layer between the model's back and the pectoral muscle, on a torso of known shape."""

import numpy as np
import pytest

from mammoreg.geometry import Volume
from mammoreg.imaging.mr_layer import LEAST_LAYER_MM, MuscleFront, muscle_front
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, locate_body, no_bias, segment_volume
from tests.unit.torso_phantom import CHEST_P, RIGHT, torso

SETTINGS = SegmentSettings(spacing_mm=2.0)
MUSCLE_MM = 14.0
"""How far behind the chest's skin the phantom's muscle begins."""


def without_muscle(volume: Volume) -> Volume:
    """Fat where the phantom has muscle and lung."""
    points = volume.to_world(np.moveaxis(np.indices(volume.shape), 0, -1))
    deep = points[..., 1] - CHEST_P - 0.002 * points[..., 0] ** 2 > MUSCLE_MM - 4.0
    fat = np.median(volume.data[(volume.data > 100.0) & (RIGHT.radius(points) < 0.9)])
    return volume.with_data(np.where(deep & (volume.data > 100.0), np.minimum(volume.data, fat), volume.data))


def true_distance_mm(found: Segmentation) -> float:
    muscle = CHEST_P + 0.002 * found.back[:, 0] ** 2 + MUSCLE_MM
    return float(np.median(muscle - found.back[:, 1]))


@pytest.mark.parametrize("fat_suppressed", [True, False], ids=["fat-suppressed", "fat bright"])
@pytest.mark.parametrize("forward_mm", [0.0, 15.0])
def test_layer_is_the_distance_from_the_back_to_the_muscle(fat_suppressed: bool, forward_mm: float) -> None:
    volume = torso(fat_suppressed=fat_suppressed, noise=10.0)
    found = segment_volume(volume, None, SETTINGS, no_bias)
    assert found.muscle.distance_mm == pytest.approx(true_distance_mm(found), abs=2.5)
    assert found.muscle.layer_mm == max(found.muscle.distance_mm, LEAST_LAYER_MM)
    grid, body, _ = locate_body(volume, None, SETTINGS.spacing_mm)
    inside = found.mr.with_data(found.breast.astype(np.float32)).sample(
        grid.to_world(np.moveaxis(np.indices(grid.shape), 0, -1)), order=0
    )
    moved = found.back - np.array([0.0, forward_mm, 0.0])
    again = muscle_front(grid, body, inside > 0.5, moved, fat_suppressed)
    assert again.distance_mm == pytest.approx(found.muscle.distance_mm + forward_mm, abs=2.0)


def test_a_muscle_that_does_not_show_gives_no_layer() -> None:
    found = segment_volume(without_muscle(torso()), None, SETTINGS, no_bias)
    assert found.muscle.layer_mm is None


def test_a_coil_that_fades_moves_no_muscle() -> None:
    volume = torso()
    p = volume.origin[1] + volume.spacing[1] * np.arange(volume.shape[1])
    fading = volume.with_data((volume.data * np.exp(-(p + 45.0) / 120.0)[None, :, None]).astype(np.float32))
    plain, faded = (segment_volume(v, None, SETTINGS, no_bias).muscle for v in (volume, fading))
    assert faded.distance_mm == pytest.approx(plain.distance_mm, abs=2.5)


def test_a_back_on_the_muscle_has_the_least_layer() -> None:
    assert MuscleFront(1.0, 0.5, 0.9).layer_mm == LEAST_LAYER_MM
    assert MuscleFront(20.0, 0.5, 0.9).layer_mm == 20.0
    assert MuscleFront(20.0, 0.1, 0.9).layer_mm is None
    assert MuscleFront(20.0, 0.5, 0.3).layer_mm is None
