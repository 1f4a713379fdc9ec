"""Marks that cannot be what they are said to be: outside the breast, in air, or as large as the breast.

They are flagged, or nothing is predicted for them. What is predicted for the others does not change.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.lesions import LesionArea
from mammoreg.localization.outside import distance_outside_mm, distance_outside_px
from mammoreg.metrics.distances import breast_scale_mm
from stages.annotations import IMAGE_AIR_MM
from stages.localize.record import FILLING, LARGE, STRAY
from stages.pose.record import PoseRecord

BEHIND_MM = 15.0
"""Marks this far outside the model are flagged; those of sound cases end at 9 mm behind it, but where the breast is
deeper than the model (33 mm)."""
REFUSED_MM = 45.0
"""Marks this far outside are refused: an eighth of a metre of breast cannot be missing."""
IN_AIR_MM = 5.0
"""Marks in the air this far from the breast are flagged; those on the skin lie within 2 mm."""
IMAGE_REFUSED_MM = 15.0
"""Marks in a mammogram's air this far from the breast are refused; no outline is that far off where it is found."""
FILLS = 0.5
"""A lesion of more than this share of the breast is refused: no lesion is that large."""
LARGE_SHARE, LARGE_AREA = 0.15, 0.3
"""Chosen: more of a breast's volume, of its area in a mammogram, is flagged; 50 mm across is 65 ml and 20 cm2."""
_RAS = (-1.0, -1.0, 1.0)


@dataclass(frozen=True)
class Stray:
    """What speaks against a mark; `refused`: nothing is predicted for it."""

    message: str
    refused: bool


class Extended(Protocol):
    """A lesion of the MR volume."""

    def contains(self, points: Points) -> NDArray[np.bool_]:
        """Whether points (N, 3) lie in it."""


def strays_in_mr(
    points: Mapping[str, Points], breast: Volume, labels: Volume, laterality: Laterality
) -> dict[str, Stray]:
    """Marks of the MR volume that do not lie in the breast, by name.

    Args:
        points: centres (3,) by name, breast frame.
        breast, labels: its mask, and the tissue map whose 0 is air.
    """
    if not points:
        return {}
    places = np.array(list(points.values()))
    far = distance_outside_mm(places, breast)
    air = (labels.sample(places, order=0, outside=-1.0) == 0.0) & (far > IN_AIR_MM)
    limit_m = float(breast.centres(np.asarray(breast.data) != 0)[:, 0].max())
    found = {}
    for name, place, mm, in_air in zip(points, places, far, air, strict=True):
        if mm <= BEHIND_MM and not in_air:
            continue
        beyond = ", towards the other breast" if place[0] > limit_m + BEHIND_MM else ""
        text = f"{STRAY}, {mm:.0f} mm from the {laterality} breast's model{beyond}"
        found[name] = Stray(f"{text}; {_remedy(place, breast, laterality)}", bool(mm > REFUSED_MM))
    return found


def _remedy(place: Points, breast: Volume, laterality: Laterality) -> str:
    lps = breast_to_lps(place, laterality)
    for signs in sorted(product((1.0, -1.0), repeat=3), key=lambda s: s != _RAS):
        if min(signs) > 0.0:
            continue
        moved = lps_to_breast(lps * np.array(signs), laterality)
        if distance_outside_mm(moved[None], breast)[0] == 0.0:
            negated = " and ".join(axis for axis, sign in zip("xyz", signs, strict=True) if sign < 0.0)
            frame = " (RAS instead of LPS?)" if signs == _RAS else ""
            return f"with {negated} negated it lies inside{frame}"
    return "check its frame and the laterality"


def filling(lesions: Mapping[str, Extended], breast: Volume) -> dict[str, Stray]:
    """Lesions of the MR volume that fill the breast, or much of it, by name, breast frame."""
    inside = breast.centres(np.asarray(breast.data) != 0)
    shares = {name: float(lesion.contains(inside).mean()) for name, lesion in lesions.items()}
    return {name: _large(share) for name, share in shares.items() if share > LARGE_SHARE}


def _large(share: float) -> Stray:
    if share > FILLS:
        return Stray(f"{FILLING} ({share:.0%} of it), more than any lesion; mark it alone", refused=True)
    return Stray(f"{LARGE}, {share:.0%} of the breast; check that the mark holds nothing else", refused=False)


def strays_in_mammogram(areas: Mapping[str, LesionArea], pose: PoseRecord) -> dict[str, Stray]:
    """Lesions of a mammogram that lie in its air or fill its breast, by name."""
    breast = pose.tissue != 0
    scale_mm = breast_scale_mm(pose.geometry)
    found = {}
    for name, area in areas.items():
        share = area.pixels / max(int(np.count_nonzero(breast)), 1)
        mm = distance_outside_px(area.centre, breast) * scale_mm
        if share > LARGE_AREA:
            found[name] = _large(share)
        elif mm > IMAGE_AIR_MM:
            text = f"{STRAY}, {mm:.0f} mm from it in {pose.view}"
            found[name] = Stray(f"{text}; {_image_remedy(area.centre, breast)}", mm > IMAGE_REFUSED_MM)
    return found


def _image_remedy(centre: NDArray[np.float64], breast: NDArray[np.bool_]) -> str:
    rows, columns = breast.shape
    column, row = centre
    turned = {
        "with column and row exchanged": (row, column),
        "mirrored left to right": (columns - 1 - column, row),
        "turned upside down": (column, rows - 1 - row),
        "turned by 180 degrees": (columns - 1 - column, rows - 1 - row),
    }
    for how, pixel in turned.items():
        if distance_outside_px(np.array(pixel), breast) == 0.0:
            return f"{how} it lies inside: mark it on the image as stored"
    return "mark it on the image as stored"
