"""The side of a breast that is alone in its volume: by its shape, by its place, and what neither tells."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mr_body import body_mask
from mammoreg.imaging.mr_grid import block_mean
from mammoreg.imaging.mr_laterality import SideEvidence, check_side
from mammoreg.imaging.mr_segment import COARSE_MM, SegmentSettings, no_bias, segment_volume
from mammoreg.imaging.mr_side import find_breast
from tests.shared_data import DATA, requires_shared
from tests.unit.torso_phantom import LEFT, RIGHT, torso


def evidence(volume: Volume, side: Laterality) -> SideEvidence | None:
    coarse = block_mean(volume.to_breast(side), COARSE_MM)
    return find_breast(body_mask(coarse), coarse).side


def told(volume: Volume, side: Laterality) -> str:
    found = evidence(volume, side)
    assert found is not None
    return check_side(found)


def moved(volume: Volume, mm: float) -> Volume:
    return replace(volume, origin=volume.origin + np.array([mm, 0.0, 0.0]))


def mirrored(volume: Volume) -> Volume:
    """The same header with its voxels the other way round."""
    return volume.with_data(np.ascontiguousarray(volume.data[::-1]))


RIGHT_ALONE = torso((RIGHT,), x_range=(-150.0, 12.0))
LEFT_ALONE = torso((LEFT,), x_range=(-14.0, 150.0))


def test_a_breast_of_the_right_side_is_not_doubted() -> None:
    assert told(RIGHT_ALONE, "R") == told(LEFT_ALONE, "L") == ""


@pytest.mark.parametrize("shift_mm", [0.0, 67.0, 150.0])
def test_the_shape_tells_a_wrong_side_wherever_the_origin_is(shift_mm: float) -> None:
    for volume, wrong in ((moved(RIGHT_ALONE, shift_mm), "L"), (moved(LEFT_ALONE, -shift_mm), "R")):
        with pytest.raises(DataError, match="shaped like one of the other side.*check laterality"):
            told(volume, wrong)  # type: ignore[arg-type]


def test_a_volume_mirrored_against_its_header_is_told() -> None:
    with pytest.raises(DataError, match="not mirrored"):
        told(mirrored(RIGHT_ALONE), "R")


def test_a_shifted_origin_alone_is_a_doubt() -> None:
    assert "the volume's origin may be shifted" in told(moved(RIGHT_ALONE, 170.0), "R")
    assert told(moved(RIGHT_ALONE, 150.0), "R") == "", "an origin at the border was set by a program"


def test_place_alone_refuses_where_the_shape_tells_nothing() -> None:
    with pytest.raises(DataError, match="lies 70 mm on the other side of the body's middle"):
        check_side(SideEvidence(None, -70.0))
    assert check_side(SideEvidence(None, 70.0)) == check_side(SideEvidence(None, None)) == ""
    assert check_side(SideEvidence(-3.0, 5.0)) == "", "nothing is told by so little"


def test_both_breasts_in_view_contradict_nothing() -> None:
    both = torso()
    assert evidence(both, "R") is None
    assert evidence(both, "L") is None


def test_the_segmentation_refuses_a_wrong_side() -> None:
    with pytest.raises(DataError, match="check laterality"):
        segment_volume(RIGHT_ALONE.to_breast("L"), None, SegmentSettings(3.0), no_bias)


@requires_shared("twins")
@pytest.mark.parametrize("name", ["twin1", "volunteer"])
def test_single_breasts_of_the_twins(name: str) -> None:
    from stages.cohort.readers.mr.volume import read_mr

    volume = read_mr(DATA / "twins" / "mr" / f"{name}.nii.gz")
    assert told(volume, "R") == ""
    with pytest.raises(DataError, match="check laterality"):
        told(volume, "L")
