"""Stage `segment`: the breast of the MR volume: tissues, mask, chest-wall surface, nipple; the second volume's mask."""

from dataclasses import replace

import numpy as np
from pydantic import Field

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, breast_to_lps
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mr_chest_wall import BackSettings
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, segment_body, segment_volume
from stages.cohort.readers.mr import read_mr, read_nifti
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value, VolumeField
from stages.segment.bias import n4_field

_SAME_PLACE_MM = 0.1


class Settings(SettingsModel):
    """The working grid, and where the breast's back lies."""

    spacing_mm: float = Field(1.4, ge=1.0, le=3.0, description="voxels of the working grid, mm (paper: 1.4)")
    forward_share: float = Field(
        0.05, ge=0.0, le=0.5, description="back in front of the corners between breast and chest, share of their depth"
    )
    max_depth_mm: float = Field(120.0, ge=40.0, le=250.0, description="greatest depth of the model below the apex, mm")
    min_depth_mm: float = Field(20.0, ge=5.0, le=40.0, description="a breast that stands out less is refused, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Segment the breast; of the second volume only the body's mask is kept."""
    mr_path, labels_path, compressed_path = (inputs.path(n) for n in ("mr", "mr_labels", "mr_compressed"))
    assert mr_path is not None
    side = subject.laterality
    mr = read_mr(mr_path)
    labels = None if labels_path is None else read_nifti(labels_path)
    if labels is not None and not _same_grid(mr, labels):
        raise DataError("mr_labels lies on another grid than mr; resample it onto the MR grid")
    choices = SegmentSettings(settings.spacing_mm, _back_settings(settings))
    breast_labels = None if labels is None else labels.to_breast(side)
    found = segment_volume(mr.to_breast(side), breast_labels, choices, n4_field)
    fields = _fields(found, side)
    if compressed_path is None:
        return fields
    mask = segment_body(read_mr(compressed_path).to_breast(side), settings.spacing_mm)
    volume = VolumeField(mask.to_lps(side), "1", "body in the compressed volume, chest included")
    return replace(fields, volumes={**fields.volumes, "compressed_mask": volume})


def _back_settings(settings: Settings) -> BackSettings:
    return BackSettings(
        forward_share=settings.forward_share, max_depth_mm=settings.max_depth_mm, min_depth_mm=settings.min_depth_mm
    )


def _same_grid(one: Volume, other: Volume) -> bool:
    """Whether two volumes have the same voxels, to a tenth of a millimetre."""
    if one.shape != other.shape:
        return False
    last = np.array(one.shape) - 1
    distances = [one.origin - other.origin, one.to_world(last) - other.to_world(last)]
    return bool(np.abs(distances).max() < _SAME_PLACE_MM)


def _fields(found: Segmentation, side: Laterality) -> Fields:
    grid = found.mr
    volumes = {
        "mr": VolumeField(grid.to_lps(side), "1", "MR intensity, bias-corrected"),
        "labels": VolumeField(
            grid.with_data(found.labels).to_lps(side),
            "1",
            "tissue: 0 background, 1 fat, 2 gland, 3 skin, 4 muscle/chest wall",
        ),
        "breast_mask": VolumeField(
            grid.with_data(found.breast.astype(np.uint8)).to_lps(side),
            "1",
            "breast in front of the chest-wall surface",
        ),
    }
    arrays = {
        "chest_wall_surface": Array(breast_to_lps(found.back, side), "mm", "points on the back surface of the breast"),
        "nipple": Array(breast_to_lps(found.nipple, side), "mm", "nipple in the MR volume"),
    }
    values: dict[str, Value] = {
        "fat_suppressed": found.fat_suppressed,
        "breast_volume_ml": round(float(found.breast.sum()) * grid.voxel_mm3 / 1000.0, 3),
        "gland_share": round(float((found.labels[found.breast] == 2).mean()), 4),
    }
    return Fields(arrays=arrays, volumes=volumes, values=values)


STAGE = Stage(
    name="segment",
    schema=1,
    inputs=("mr",),
    optional=("mr_labels", "mr_compressed"),
    settings=Settings,
    run=run,
)
