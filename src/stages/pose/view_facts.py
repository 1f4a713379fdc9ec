"""What a view shows of the breast: its outline and the geometry that the image or the second volume tells."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.acquisition import Mammogram
from mammoreg.imaging.mammogram import MammogramAnalysis
from mammoreg.imaging.views import View, view_named
from mammoreg.pose.outlined import OUTLINE_RAYS, OutlinedMammogram, OutlinedView, outlined_mammograms
from mammoreg.pose.plates import find_plates
from mammoreg.pose.second_volume import outline_of_mask, parallel_view
from mammoreg.pose.silhouette import ray_angles
from stages.cohort.readers.mammogram.header import MammogramFacts
from stages.cohort.readers.mammogram.image import read_mammogram
from stages.engine.contract import Subject, Value
from stages.pose.record import ImageOutline, ImageStorage

UNSTEPPED_SHARE = 0.05
"""More of an outline without a grey step across it is a doubt; on 22 real mammograms it was at most 0.01."""
CUT_MM = 5.0
"""More of a breast cut at the image's anterior edge is a doubt; chosen: less is a nipple."""
MUSCLE_BELOW = (
    "the pectoral muscle shows in the inferior corner alone: check the orientation, the rows may run the other way"
)


@dataclass(frozen=True)
class ViewFacts:
    """A view before its pose is known.

    Attributes:
        seen: what a model is compared with.
        estimated: what neither header nor table gave.
        flags: doubts.
        image: the outline as the image shows it.
        mammogram, tissue: canonical image and its labels; None without one.
        storage: of the mammogram.
        values: what the artefact takes over besides.
    """

    seen: OutlinedView
    image: ImageOutline
    estimated: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    mammogram: NDArray[Any] | None = None
    tissue: NDArray[np.uint8] | None = None
    storage: ImageStorage | None = None
    values: dict[str, Value] = field(default_factory=dict)


def facts_of_mammogram(path: Path, subject: Subject) -> tuple[tuple[ViewFacts, ...], tuple[OutlinedMammogram, ...]]:
    """Read and analyse a mammogram, in both orders of its rows where its orientation is not known, the usual first.

    Raises:
        DataError: the image cannot be used, or its pixel spacing is unknown.
    """
    view = view_of(subject)
    stored = read_mammogram(path, subject.row, subject.laterality, view)
    facts = stored.facts
    if facts.pixel_mm is None:
        raise DataError(f"{path.name}: the pixel spacing is unknown; give pixel_spacing_mm in the views table")
    mammogram = Mammogram(
        stored.pixels,
        view,
        facts.pixel_mm,
        facts.thickness_mm,
        facts.angle_deg,
        facts.source_detector_mm,
        facts.support_detector_mm,
        facts.orientation,
        facts.photometric,
        facts.linear,
    )
    orders = outlined_mammograms(mammogram, subject.laterality)
    return tuple(_facts(outlined, facts) for outlined in orders), orders


def view_of(subject: Subject) -> View:
    """The mammogram's view of a stage's subject."""
    return view_named(subject.view)


def _facts(outlined: OutlinedMammogram, facts: MammogramFacts) -> ViewFacts:
    image, found = outlined.image, outlined.found
    rows, columns = image.pixels.shape
    return ViewFacts(
        seen=outlined.view,
        image=ImageOutline(found.outline, found.outline_weight),
        estimated=tuple(dict.fromkeys((*facts.estimated, *image.estimated))),
        flags=(*facts.flags, *_outline_doubts(found)),
        mammogram=image.pixels,
        tissue=_tissue(found),
        storage=ImageStorage(rows, columns, bool(image.flips.rows), bool(image.flips.columns)),
        values={
            "chest_wall_side": image.flips.chest_wall_side,
            "nipple_px": None if found.nipple is None else [float(x) for x in found.nipple],
            "header_force_n": facts.force_n,
            "outline_step": found.step,
        },
    )


def _outline_doubts(found: MammogramAnalysis) -> tuple[str, ...]:
    missing = 1.0 - found.stepped_share
    doubts = {
        f"no grey step across {missing:.0%} of the outline": missing > UNSTEPPED_SHARE,
        f"breast cut over {found.cut_mm:.0f} mm at the image's anterior edge": found.cut_mm > CUT_MM,
        MUSCLE_BELOW: found.muscle_below,
    }
    return tuple(text for text, holds in doubts.items() if holds)


def facts_of_second_volume(mask: Volume) -> ViewFacts:
    """Plates and silhouette of a second MR volume's body mask (breast frame)."""
    plates = find_plates(mask)
    geometry = parallel_view(mask, plates)
    outline = outline_of_mask(mask, geometry, ray_angles(OUTLINE_RAYS))
    points = outline.points()
    known = np.isfinite(points).all(axis=1)
    pixels = np.stack(
        [points[:, 0] / geometry.pixel_mm - 0.5, points[:, 1] / geometry.pixel_mm + 0.5 * (geometry.rows - 1)], axis=-1
    )
    meaning = "outline of the second volume along the compression, (column, row)"
    image = ImageOutline(pixels[known], outline.weight[known], meaning)
    values: dict[str, Value] = {"contact_mm2": list(plates.contact_mm2)}
    return ViewFacts(OutlinedView(geometry, outline, placed=True), image, values=values)


def _tissue(found: MammogramAnalysis) -> NDArray[np.uint8]:
    """Labels of the canonical image: 0 air, 1 breast, 2 pectoral muscle."""
    tissue = found.mask.astype(np.uint8)
    if found.pectoral is not None:
        tissue[found.pectoral & found.mask] = 2
    return tissue
