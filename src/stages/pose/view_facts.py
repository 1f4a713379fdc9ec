"""What a view shows of the breast: its outline and the geometry that the image or the second volume tells."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.imaging.mammogram import MammogramAnalysis, analyse
from mammoreg.imaging.mammogram_canonical import CanonicalMammogram, canonicalise
from mammoreg.imaging.mammogram_orientation import View
from mammoreg.pose.density import DensityImage, mammogram_structure
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.plates import find_plates
from mammoreg.pose.second_volume import outline_of_mask, parallel_view
from mammoreg.pose.silhouette import pixels_at_detector, ray_angles
from stages.cohort.readers.mammogram import read_mammogram
from stages.engine.contract import Array, Subject, Value
from stages.methods import OUTLINE_RAYS

TISSUE_CODES = "0 air, 1 breast, 2 pectoral muscle"


@dataclass(frozen=True)
class Seen:
    """A view before its pose is known.

    Attributes:
        geometry: angle, thickness (nan where unknown), source, detector; of the rest only a second volume knows.
        outline: on rays, mm at the detector.
        placed: whether edge, middle and height are known (second volume).
        density: dense tissue of a mammogram.
        nipple: (2,) canonical (column, row), or None.
        estimated: what neither header nor table gave.
        flags: doubts.
        arrays, values: what the artefact takes over.
    """

    geometry: ViewGeometry
    outline: RadialOutline
    placed: bool
    density: DensityImage | None = None
    nipple: NDArray[np.float64] | None = None
    estimated: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    arrays: dict[str, Array] = field(default_factory=dict)
    values: dict[str, Value] = field(default_factory=dict)


def see_mammogram(path: Path, subject: Subject, view: View) -> Seen:
    """Read and analyse a mammogram.

    Raises:
        DataError: the image cannot be used, or its pixel spacing is unknown.
    """
    stored = read_mammogram(path, subject.row, subject.laterality, view)
    facts = stored.facts
    if facts.pixel_mm is None:
        raise DataError(f"{path.name}: the pixel spacing is unknown; give pixel_spacing_mm in the views table")
    image = canonicalise(
        stored.pixels,
        subject.laterality,
        view,
        orientation=facts.orientation,
        photometric=facts.photometric,
        linear=facts.linear,
    )
    found = analyse(image.pixels, facts.pixel_mm, view)
    rows, columns = image.pixels.shape
    thickness = facts.thickness_mm if facts.thickness_mm is not None else float("nan")
    geometry = ViewGeometry(
        angle_deg=facts.angle_deg,
        edge_p_mm=0.0,
        middle_mm=0.0,
        height_mm=0.0,
        thickness_mm=thickness,
        source_detector_mm=facts.source_detector_mm,
        support_detector_mm=facts.support_detector_mm,
        pixel_mm=facts.pixel_mm,
        rows=rows,
        columns=columns,
    )
    breast = found.mask if found.pectoral is None else found.mask & ~found.pectoral
    return Seen(
        geometry=geometry,
        outline=radial_outline(
            pixels_at_detector(found.outline, geometry), found.outline_weight, ray_angles(OUTLINE_RAYS)
        ),
        placed=False,
        density=mammogram_structure(image.pixels, breast, facts.pixel_mm),
        nipple=found.nipple,
        estimated=tuple(dict.fromkeys((*facts.estimated, *image.estimated))),
        flags=(*facts.flags, *image.flags),
        arrays=_image_arrays(image, found),
        values={
            "flip_rows": bool(image.flips.rows),
            "flip_columns": bool(image.flips.columns),
            "stored_rows": rows,
            "stored_columns": columns,
            "chest_wall_side": image.flips.chest_wall_side,
            "nipple_px": None if found.nipple is None else [float(x) for x in found.nipple],
            "header_force_n": facts.force_n,
        },
    )


def see_second_volume(mask: Volume) -> Seen:
    """Plates and silhouette of a second MR volume's body mask (breast frame)."""
    plates = find_plates(mask)
    geometry = parallel_view(mask, plates)
    outline = outline_of_mask(mask, geometry, ray_angles(OUTLINE_RAYS))
    points = outline.points()
    known = np.isfinite(points).all(axis=1)
    pixels = np.stack(
        [points[:, 0] / geometry.pixel_mm - 0.5, points[:, 1] / geometry.pixel_mm + 0.5 * (geometry.rows - 1)], axis=-1
    )
    arrays = {
        "outline": Array(pixels[known], "px", "outline of the second volume along the compression, (column, row)"),
        "outline_weight": Array(outline.weight[known], "1", "trust in the outline"),
    }
    values: dict[str, Value] = {"contact_mm2": list(plates.contact_mm2)}
    return Seen(geometry, outline, placed=True, arrays=arrays, values=values)


def _image_arrays(image: CanonicalMammogram, found: MammogramAnalysis) -> dict[str, Array]:
    tissue = found.mask.astype(np.uint8)
    if found.pectoral is not None:
        tissue[found.pectoral & found.mask] = 2
    return {
        "mammogram": Array(image.pixels, "1", "canonical mammogram, bright is dense"),
        "breast_mask": Array(tissue, "1", f"canonical image: {TISSUE_CODES}"),
        "outline": Array(found.outline, "px", "outline between skin and air, canonical (column, row)"),
        "outline_weight": Array(found.outline_weight, "1", "1 where the outline is skin, fading to 0 elsewhere"),
    }
