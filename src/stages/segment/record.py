"""What stage `segment` leaves: the breast of the MR volume, and the mask of the second one."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.anatomy import RANGES
from mammoreg.imaging.mr_checks import Check
from mammoreg.labels import Label
from stages.engine.artefact import Array, Fields, Value, VolumeField
from stages.engine.record import Record

_TISSUES = {label: label.name.lower() for label in Label} | {Label.MUSCLE: "muscle/chest wall"}
_VOLUMES = {
    "mr": "MR intensity, bias-corrected",
    "labels": "tissue: " + ", ".join(f"{label.value} {_TISSUES[label]}" for label in Label),
    "breast_mask": "breast in front of the chest-wall surface",
    "compressed_mask": "body in the compressed volume, chest included",
}


def segment_fields(
    volumes: Mapping[str, Volume], back: Points, nipple: Points, side: Laterality, values: Mapping[str, Value]
) -> Fields:
    """The artefact's contents from what was found in the breast frame.

    Args:
        volumes: `mr`, `labels`, `breast_mask` and, of a second volume, `compressed_mask`.
        back: points (N, 3) on the back surface of the breast, mm.
        nipple: (3,), mm.
        side: of the breast.
        values: what else was found.
    """
    return Fields(
        arrays={
            "chest_wall_surface": Array(breast_to_lps(back, side), "mm", "points on the back surface of the breast"),
            "nipple": Array(breast_to_lps(nipple, side), "mm", "nipple in the MR volume"),
        },
        volumes={name: VolumeField(volume.to_lps(side), "1", _VOLUMES[name]) for name, volume in volumes.items()},
        values=values,
    )


def check_row(check: Check) -> dict[str, Any]:
    """A row of `segmentation.csv`, without its column `case`; a limit that there is not is empty."""
    usual = RANGES[check.name]
    low, high = (limit if np.isfinite(limit) else None for limit in (usual.low, usual.high))
    return {
        "check": check.name,
        "value": None if check.value is None else round(check.value, 4),
        "low": low,
        "high": high,
        "unit": usual.unit,
        "doubt": check.doubt,
    }


class SegmentRecord(Record):
    """The segmented breast; each property in the breast frame unless its name ends in `_lps`."""

    @property
    def mr_lps(self) -> Volume:
        """MR intensity, bias-corrected."""
        return self.artefact.volume("mr")

    @property
    def labels_lps(self) -> Volume:
        """Label of each voxel's tissue."""
        return self.artefact.volume("labels")

    @property
    def breast_mask_lps(self) -> Volume:
        """The breast in front of the chest-wall surface."""
        return self.artefact.volume("breast_mask")

    @property
    def compressed_mask_lps(self) -> Volume | None:
        """Body in the second volume, chest included; None without one."""
        return self.artefact.volume("compressed_mask") if self._has_second_volume else None

    @cached_property
    def _has_second_volume(self) -> bool:
        return "compressed_mask" in self.artefact.volume_names()

    @property
    def back_layer_mm(self) -> float | None:
        """Soft tissue between the model's back and the muscle; None where the volume does not show it."""
        return self._number("back_layer_mm")

    @property
    def doubts(self) -> Sequence[str]:
        """What speaks against the segmentation, in words."""
        return list(self._given("warnings", []))

    @property
    def mr(self) -> Volume:
        """As `mr_lps`."""
        return self.mr_lps.to_breast(self.laterality)

    @property
    def labels(self) -> Volume:
        """As `labels_lps`."""
        return self.labels_lps.to_breast(self.laterality)

    @property
    def breast_mask(self) -> Volume:
        """As `breast_mask_lps`."""
        return self.breast_mask_lps.to_breast(self.laterality)

    @property
    def compressed_mask(self) -> Volume | None:
        """As `compressed_mask_lps`."""
        mask = self.compressed_mask_lps
        return None if mask is None else mask.to_breast(self.laterality)

    @property
    def mr_series(self) -> list[dict[str, str]]:
        """The MR series of folders of DICOM files, a row each, first the one taken; empty where none was chosen."""
        rows = []
        for column in ("mr", "mr_compressed"):
            if self.artefact.has(f"{column}_series"):
                rows.append({"column": column, "series": str(self.artefact.value(f"{column}_series")), "": "taken"})
                left = self.artefact.value(f"{column}_series_left")
                rows += [{"column": column, "series": row["series"], "": row["left because"]} for row in left]
        return rows

    @property
    def nipple_lps(self) -> Points:
        """Nipple (3,), mm."""
        return np.asarray(self.artefact.array("nipple", "mm"), dtype=float)

    @property
    def nipple(self) -> Points:
        """As `nipple_lps`."""
        return lps_to_breast(self.nipple_lps, self.laterality)

    @property
    def chest_wall(self) -> Points:
        """Points (N, 3) on the back surface of the breast, mm."""
        return lps_to_breast(self.artefact.array("chest_wall_surface", "mm"), self.laterality)
