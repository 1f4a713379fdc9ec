"""From an MR volume to the breast: mask, tissues, back, nipple. All in the breast frame."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Bools, Points
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_body import body_mask
from mammoreg.imaging.mr_breast import back_points, breast_mask
from mammoreg.imaging.mr_checks import Check, Seen, check_anatomy, check_field_of_view
from mammoreg.imaging.mr_chest_wall import BackSettings, BackSurface, back_before_chest
from mammoreg.imaging.mr_grid import Box, block_mean, nearest_labels, working_volume
from mammoreg.imaging.mr_laterality import check_side
from mammoreg.imaging.mr_layer import MuscleFront, muscle_front
from mammoreg.imaging.mr_muscle import back_at_muscle
from mammoreg.imaging.mr_nipple import find_nipple
from mammoreg.imaging.mr_side import BreastPlace, find_breast
from mammoreg.imaging.mr_tissue import depth_below_skin, gland_threshold, is_fat_suppressed, label_tissues
from mammoreg.labels import Label

BiasField = Callable[[Volume, Bools], NDArray[np.float32]]
"""Estimates the coil's smooth multiplicative field of a volume from the voxels of a mask."""

COARSE_MM = 4.0
REACH_MM = np.array([90.0, 210.0, 110.0])
"""The breast and the chest behind it lie within this distance of the apex."""
MARGIN_MM = 18.0


def no_bias(volume: Volume, mask: Bools) -> NDArray[np.float32]:
    """The field of a coil without inhomogeneity."""
    return np.ones(volume.shape, dtype=np.float32)


@dataclass(frozen=True)
class SegmentSettings:
    """Choices of the segmentation: working grid's spacing in mm, and those of the back."""

    spacing_mm: float = 1.4
    back: BackSettings = field(default_factory=BackSettings)


@dataclass(frozen=True)
class Segmentation:
    """The breast of an MR volume in the breast frame.

    Attributes:
        mr: bias-corrected intensities on the working grid, float32.
        labels: 0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall.
        breast: the breast in front of the chest-wall surface.
        back: points (N, 3) on that surface, mm.
        nipple: (3,), mm.
        fat_suppressed: whether fat is dark.
        muscle: where the pectoral muscle begins behind the back.
        checks: measurements beside what is usual of a breast.
        side_doubt: what speaks against the side, in words; empty where nothing does.
    """

    mr: Volume
    labels: NDArray[np.uint8]
    breast: Bools
    back: Points
    nipple: Points
    fat_suppressed: bool
    muscle: MuscleFront
    checks: tuple[Check, ...] = ()
    side_doubt: str = ""


def segment_volume(
    volume: Volume, labels: Volume | None, settings: SegmentSettings, bias_field: BiasField
) -> Segmentation:
    """Segment the breast.

    Args:
        volume: MR intensities in the breast frame.
        labels: a given label map on the same grid; it replaces the automatic one.
        settings: choices.
        bias_field: how the coil's inhomogeneity is estimated.

    Raises:
        DataError: no usable breast of that side in the volume; the message says what was missing.
    """
    grid, body, place = locate_body(volume, labels, settings.spacing_mm)
    doubt = "" if place.side is None else check_side(place.side)
    given = None if labels is None else nearest_labels(labels, grid)
    back = _find_back(grid, body, given, place.apex, settings)
    breast = breast_mask(body, grid, back, place.apex)
    if given is not None:
        breast &= given != Label.MUSCLE
    box = _box_around(breast, int(MARGIN_MM / settings.spacing_mm))
    whole, whole_body, whole_breast = grid, body, breast
    grid, body, breast = _crop(grid, box), body[box], breast[box]
    points = back_points(breast, grid, back)
    corrected = grid.with_data(grid.data / bias_field(grid, breast))
    depth = depth_below_skin(body, grid.spacing)
    suppressed = is_fat_suppressed(corrected.data, depth, breast)
    muscle = muscle_front(whole, whole_body, whole_breast, points, suppressed)
    if given is None:
        tissues = label_tissues(corrected, body, breast, depth, suppressed)
    else:
        tissues = np.where(body, np.where(given[box] == 0, Label.SKIN, given[box]), 0).astype(np.uint8)
    reach = float(back.posterior(place.apex[0], place.apex[2]) - place.apex[1])
    nipple = find_nipple(corrected, body, depth, suppressed, place.apex, reach)
    seen = Seen(volume, corrected, body, breast, tissues, depth, suppressed, muscle, place.heights_mm)
    checks = check_anatomy(seen)
    return Segmentation(corrected, tissues, breast, points, nipple, suppressed, muscle, checks, doubt)


def segment_body(volume: Volume, spacing_mm: float) -> Volume:
    """Mask (uint8) of the body around the wanted breast in a volume of the breast frame, chest included.

    Raises:
        DataError: no usable breast in the volume.
    """
    grid, body, _ = locate_body(volume, None, spacing_mm)
    return grid.with_data(body.astype(np.uint8))


def locate_body(volume: Volume, labels: Volume | None, spacing_mm: float) -> tuple[Volume, Bools, BreastPlace]:
    """Working grid around the breast of the wanted side, the body on it, and where the breast stands."""
    if not np.isfinite(volume.data).all():
        raise DataError("the MR volume holds values that are not finite (NaN or infinite): export it again")
    check_field_of_view(volume)
    shape = None if labels is None else labels.with_data((labels.data > 0).astype(np.float32))
    coarse = block_mean(volume if shape is None else shape, COARSE_MM)
    coarse_body = body_mask(coarse) if shape is None else coarse.data > 0.5
    place = find_breast(coarse_body, coarse)
    box = _box_of(place)
    grid = working_volume(volume, box, spacing_mm)
    body = body_mask(grid) if shape is None else working_volume(shape, box, spacing_mm).data > 0.5
    return grid, body, place


def _box_of(place: BreastPlace) -> Box:
    """Corners of the part of the volume that is worked on, mm."""
    lower = place.apex - np.array([REACH_MM[0], MARGIN_MM, REACH_MM[2]])
    upper = place.apex + REACH_MM
    upper[0] = min(upper[0], place.midline_m)
    return lower, upper


def _find_back(
    grid: Volume, body: Bools, given: NDArray[np.uint8] | None, apex: Points, settings: SegmentSettings
) -> BackSurface:
    """The back from the outline where the volume shows the torso, else from the muscle."""
    coarse = block_mean(grid.with_data(body.astype(np.float32)), 2.0 * settings.spacing_mm)
    back = back_before_chest(coarse, apex, settings.back)
    if back is not None:
        return back
    if given is None:
        depth = depth_below_skin(body, grid.spacing)
        suppressed = is_fat_suppressed(grid.data, depth, body)
        threshold = gland_threshold(grid.data[body & (depth > 4.0)], suppressed)
        fine = np.tanh((grid.data / threshold - 1.0) * 3.0) * (-1.0 if suppressed else 1.0)
    else:
        fine = np.where(given == Label.MUSCLE, -1.0, 1.0)
    contrast = block_mean(grid.with_data(fine.astype(np.float32)), 2.0 * settings.spacing_mm)
    return back_at_muscle(contrast, coarse.data > 0.5, apex, settings.back.min_depth_mm)


def _box_around(breast: Bools, margin: int) -> tuple[slice, ...]:
    """Slices around the breast with a margin in voxels, inside the grid."""
    (found,) = ndimage.find_objects(breast.astype(np.uint8))
    return tuple(slice(max(s.start - margin, 0), s.stop + margin) for s in found)


def _crop(grid: Volume, box: tuple[slice, ...]) -> Volume:
    """The part of a volume inside slices."""
    return Volume(
        np.ascontiguousarray(grid.data[box]), grid.to_world(np.array([s.start for s in box])), grid.spacing, grid.frame
    )
