"""Stage `segment`: the breast of the MR volume: tissues, mask, chest-wall surface, nipple; the second volume's mask."""

import numpy as np
from pydantic import Field

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_chest_wall import BackSettings
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, segment_body, segment_volume
from mammoreg.labels import Label
from stages.bias import n4_field
from stages.cohort.readers.mr.choice import MrChoice
from stages.cohort.readers.mr.volume import mr_choice, read_labels, read_mr
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value, source
from stages.segment.imaged import imaged_mm
from stages.segment.record import check_row, segment_fields
from stages.views import IMAGED

_SAME_PLACE_MM = 0.1
_DEFAULTS = SegmentSettings()


class Settings(SettingsModel):
    """The working grid, and where the breast's back lies."""

    spacing_mm: float = Field(
        _DEFAULTS.spacing_mm,
        ge=1.0,
        le=3.0,
        description="voxels of the working grid, mm",
        json_schema_extra=source("the paper's"),
    )
    forward_share: float = Field(
        _DEFAULTS.back.forward_share,
        ge=0.0,
        le=0.5,
        description="back in front of the corners between breast and chest, share of their depth",
        json_schema_extra=source("chosen: the corner itself belongs to the chest"),
    )
    long_mm: float = Field(
        _DEFAULTS.back.long_mm,
        ge=40.0,
        le=250.0,
        description="breasts up to this depth below the apex are modelled whole, mm",
        json_schema_extra=source("chosen: few breasts are deeper"),
    )
    behind_edge_mm: float = Field(
        _DEFAULTS.back.behind_edge_mm,
        ge=0.0,
        le=200.0,
        description="how much further back than the case's mammograms show it a longer breast is modelled, mm; "
        "without mammograms it is modelled to the chest",
        json_schema_extra=source("chosen: what the plates' lips press and draw in"),
    )
    min_depth_mm: float = Field(
        _DEFAULTS.back.min_depth_mm,
        ge=5.0,
        le=40.0,
        description="a breast that stands out less is refused, mm",
        json_schema_extra=source("chosen: less is no breast between plates"),
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Segment the breast; of the second volume only the body's mask is kept."""
    mr_path, labels_path, compressed_path = (inputs.path(n) for n in ("mr", "mr_labels", "mr_compressed"))
    assert mr_path is not None
    side = subject.laterality
    series = subject.row.get("mr_series", "")
    shown_mm = imaged_mm(inputs, subject)
    mr, choice = read_mr(mr_path, side, series), mr_choice(mr_path, side, series)
    labels = None if labels_path is None else read_labels(labels_path)
    if labels is not None and not _same_grid(mr, labels):
        raise DataError("mr_labels lies on another grid than mr; resample it onto the MR grid")
    choices = SegmentSettings(settings.spacing_mm, _back_settings(settings, shown_mm))
    breast_labels = None if labels is None else labels.to_breast(side)
    mr = mr.to_breast(side)  # a mirrored volume takes the place of the one that was read
    found = segment_volume(mr, breast_labels, choices, n4_field)
    volumes = {
        "mr": found.mr,
        "labels": found.mr.with_data(found.labels),
        "breast_mask": found.mr.with_data(found.breast.astype(np.uint8)),
    }
    values = _values(found) | {"imaged_mm": _rounded(shown_mm, 2)} | _choice_values("mr", choice)
    if compressed_path is not None:
        values |= _choice_values("mr_compressed", mr_choice(compressed_path, side))
        second = read_mr(compressed_path, side).to_breast(side)
        volumes["compressed_mask"] = segment_body(second, settings.spacing_mm)
    return segment_fields(volumes, found.back, found.nipple, side, values)


def _back_settings(settings: Settings, shown_mm: float | None) -> BackSettings:
    return BackSettings(
        forward_share=settings.forward_share,
        long_mm=settings.long_mm,
        imaged_mm=np.inf if shown_mm is None else shown_mm,
        behind_edge_mm=settings.behind_edge_mm,
        min_depth_mm=settings.min_depth_mm,
    )


def _same_grid(one: Volume, other: Volume) -> bool:
    """Whether two volumes have the same voxels, to a tenth of a millimetre."""
    if one.shape != other.shape:
        return False
    last = np.array(one.shape) - 1
    distances = [one.origin - other.origin, one.to_world(last) - other.to_world(last)]
    return bool(np.abs(distances).max() < _SAME_PLACE_MM)


def _values(found: Segmentation) -> dict[str, Value]:
    return {
        "fat_suppressed": found.fat_suppressed,
        "breast_volume_ml": round(float(found.breast.sum()) * found.mr.voxel_mm3 / 1000.0, 3),
        "gland_share": round(float((found.labels[found.breast] == Label.GLAND).mean()), 4),
        "back_layer_mm": _rounded(found.muscle.layer_mm, 2),
        "muscle_distance_mm": round(found.muscle.distance_mm, 2),
        "muscle_step": round(found.muscle.step, 3),
        "muscle_shown_share": round(found.muscle.shown_share, 3),
        "checks": [check_row(check) for check in found.checks],
        "warnings": [doubt for doubt in (found.side_doubt, *(check.doubt for check in found.checks)) if doubt],
    }


def _rounded(value: float | None, decimals: int) -> float | None:
    return None if value is None else round(value, decimals)


def _choice_values(column: str, choice: MrChoice | None) -> dict[str, Value]:
    """Which series was taken of a column's folder of DICOM files, and why not the others."""
    if choice is None:
        return {}
    left = [{"series": what, "left because": why} for what, why in choice.left]
    return {
        f"{column}_series": choice.taken,
        f"{column}_series_left": left,
        f"{column}_series_notes": list(choice.notes),
    }


STAGE = Stage(
    name="segment",
    schema=1,
    inputs=("mr",),
    optional=("mr_labels", "mr_compressed", *(f"image_{view}" for view in IMAGED)),
    settings=Settings,
    run=run,
)
