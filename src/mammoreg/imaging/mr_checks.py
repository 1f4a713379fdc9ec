"""Whether a segmented volume shows a breast as a scanner does: measured, and compared with what is usual."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special

from mammoreg.arrays import Bools
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging import anatomy
from mammoreg.imaging.anatomy import FIELD_OF_VIEW, RANGES
from mammoreg.imaging.mr_layer import MuscleFront
from mammoreg.labels import Label

SMOOTH_MM = 5.0
"""Standard deviation that makes a surface smooth."""
OFF_MM = 2.5
"""Skin this far from the smooth surface is rough."""
LAYER_MM = 4.5
"""Depth of the layer below the skin that must outshine the air beside it."""
INSIDE_MM = 5.0
"""Deeper than this lies the breast's inside, beyond skin and its blur."""
BELOW_AIR = 3.0
"""Magnitudes (Rayleigh) lie at most 2.6 median deviations below their median, 2 % of differences (Gauss) below 3."""
NEGATIVE_SHARE = 0.01
"""Beyond this share of such values in air the volume is a difference."""
HINT = "hand in the volume as it was scanned before contrast agent, no subtraction, projection or part of one"


@dataclass(frozen=True)
class Check:
    """One measurement of a segmentation beside its usual range.

    Attributes:
        name: key of `anatomy.RANGES`.
        value: None where the volume does not show it.
    """

    name: str
    value: float | None

    @property
    def doubt(self) -> str:
        """What speaks against the segmentation, in words; empty where nothing does."""
        usual = RANGES[self.name]
        if self.value is None or usual.low <= self.value <= usual.high:
            return ""
        return f"{usual.what} is {_text(self.value, usual.unit)}, usual is {_span(usual.low, usual.high, usual.unit)}"

    @property
    def refused(self) -> bool:
        """Whether no breast is like that."""
        usual = RANGES[self.name]
        return self.value is not None and not usual.least <= self.value <= usual.most


@dataclass(frozen=True)
class Seen:
    """What was found of a breast, on one grid of the breast frame.

    Attributes:
        scanned: the volume as it was read, on its own grid.
        mr: bias-corrected intensities.
        body: body against air.
        breast: the breast in front of its back.
        labels: of the tissues.
        depth: below the skin, mm.
        fat_suppressed: whether fat is dark.
        muscle: where the pectoral muscle begins.
        heights_mm: of this breast and of the other one above the midline; empty where both are not in view.
    """

    scanned: Volume
    mr: Volume
    body: Bools
    breast: Bools
    labels: NDArray[np.uint8]
    depth: NDArray[np.float32]
    fat_suppressed: bool
    muscle: MuscleFront
    heights_mm: tuple[float, ...] = ()


def check_field_of_view(volume: Volume) -> None:
    """Refuse a volume that no scanner makes.

    Raises:
        DataError: a side is too short for a breast or too long for a scanner, or its air is that of a difference.
    """
    sides = np.array(volume.shape) * volume.spacing
    if sides.min() < FIELD_OF_VIEW.least or sides.max() > FIELD_OF_VIEW.most:
        raise DataError(
            f"the MR volume is {' x '.join(f'{side:.0f}' for side in sides)} mm (left-right, front-back, foot-head); a "
            f"breast needs {FIELD_OF_VIEW.least:.0f} mm and a scanner shows at most {FIELD_OF_VIEW.most:.0f} mm: check "
            "the voxel spacing, and that no slices are missing"
        )
    below = share_below_air(volume)
    if below > NEGATIVE_SHARE:
        raise DataError(
            f"{below:.0%} of the air in the MR volume lies far below its median, as in a subtraction; {HINT}"
        )


def share_below_air(volume: Volume) -> float:
    """Share of the voxels in the air before the patient that lie far below their median, where there are negatives.

    The mean may have been taken from magnitudes; interpolation rings around the body, not out there.
    """
    if float(volume.data.min()) >= 0.0:
        return 0.0
    air = volume.data[:, : max(volume.shape[1] // 16, 1)]
    level = float(np.median(air))
    spread = float(np.median(np.abs(air - level)))
    return float((air < level - BELOW_AIR * spread).mean()) if spread > 0.0 else 0.0


def check_anatomy(seen: Seen) -> tuple[Check, ...]:
    """Measure what a breast's picture must have.

    Raises:
        DataError: it is clearly none.
    """
    skin = seen.breast & (seen.depth < seen.mr.spacing[0])
    checks = (
        Check(anatomy.VOLUME, float(seen.breast.sum()) * seen.mr.voxel_mm3 / 1000.0),
        Check(anatomy.SKIN, _skin_thickness_mm(seen)),
        Check(anatomy.GLAND, float((seen.labels[seen.breast] == Label.GLAND).mean())),
        Check(anatomy.ROUGH, _rough_share(seen, skin)),
        Check(anatomy.CONTRAST, _contrast_share(seen, skin)),
        Check(anatomy.DARK, _dark_share(seen)),
        Check(anatomy.CUT, _cut_share(seen, skin)),
        Check(anatomy.HEIGHTS, seen.heights_mm[1] / seen.heights_mm[0] if seen.heights_mm else None),
        Check(anatomy.MUSCLE, seen.muscle.distance_mm if seen.muscle.shows else None),
    )
    wrong = [check for check in checks if check.refused]
    if wrong:
        raise DataError(f"no breast as a scanner shows it: {doubts(wrong)}; {HINT}")
    return checks


def doubts(checks: Sequence[Check]) -> str:
    """What speaks against a segmentation, in words; empty where nothing does."""
    return "; ".join(check.doubt for check in checks if check.doubt)


def _skin_thickness_mm(seen: Seen) -> float | None:
    """Depth at which the mean signal has come half-way from the skin's to that of what lies beneath."""
    step = 0.5 * float(seen.mr.spacing[0])
    bins = np.round(seen.depth[seen.breast] / step).astype(int)
    values = seen.mr.data[seen.breast]
    last = int(9.0 / step)
    counts = np.bincount(bins, minlength=last + 1)[: last + 1]
    sums = np.bincount(bins, weights=values, minlength=last + 1)[: last + 1]
    known = np.flatnonzero(counts > 0)
    profile = np.interp(np.arange(last + 1), known, sums[known] / counts[known])
    beneath = float(np.median(profile[int(6.0 / step) :]))
    bright = profile if seen.fat_suppressed else -profile
    level = beneath if seen.fat_suppressed else -beneath
    peak = int(np.argmax(bright[: int(4.0 / step)]))
    if bright[peak] <= level:
        return None
    after = np.flatnonzero(bright[peak:] < 0.5 * (bright[peak] + level))
    return None if not len(after) else float(step * (peak + after[0]))


def _rough_share(seen: Seen, skin: Bools) -> float | None:
    """Share of the skin far from the smooth surface; the rim at the back is left out."""
    behind = ndimage.binary_dilation(seen.body & ~seen.breast, iterations=int(SMOOTH_MM / seen.mr.spacing[0]))
    free = skin & ~behind
    soft = ndimage.gaussian_filter(seen.breast.astype(np.float32), SMOOTH_MM / seen.mr.spacing, truncate=3.0)
    # Below a plane surface the smoothed mask is the normal distribution of the depth.
    off = SMOOTH_MM * special.ndtri(np.clip(soft[free], 1e-4, 1.0 - 1e-4)) - seen.depth[free]
    return None if not off.size else float((np.abs(off) > OFF_MM).mean())


def _contrast_share(seen: Seen, skin: Bools) -> float | None:
    """Share of the skin beside which the air has less than half of the signal below."""
    size = 2 * round(3.0 / float(seen.mr.spacing[0])) + 1
    near = ndimage.binary_dilation(seen.body, iterations=2)
    outside = ndimage.binary_dilation(near, iterations=3) & ~near
    below = seen.breast & (seen.depth < LAYER_MM)
    beside, inside = (_mean_near(seen.mr.data, mask, size, skin) for mask in (outside, below))
    known = np.isfinite(beside) & np.isfinite(inside)
    return None if not known.any() else float((beside[known] < 0.5 * inside[known]).mean())


def _mean_near(data: NDArray[np.float32], mask: Bools, size: int, at: Bools) -> NDArray[np.float64]:
    """Mean of masked values in a cube around the voxels `at`; nan without any."""
    weight = ndimage.uniform_filter(mask.astype(np.float32), size)[at]
    total = ndimage.uniform_filter(np.where(mask, data, np.float32(0.0)), size)[at]
    return np.where(weight > 0.01, total / np.maximum(weight, 0.01), np.nan)


def _dark_share(seen: Seen) -> float | None:
    """Share of the scanned voxels inside the breast below the 95th percentile of those in the air around it."""
    near = ndimage.binary_dilation(seen.body, iterations=3)
    air = _scanned(seen, ndimage.binary_dilation(near, iterations=5) & ~near)
    inside = _scanned(seen, seen.breast & (seen.depth > INSIDE_MM))
    return None if not air.size or not inside.size else float((inside < np.percentile(air, 95.0)).mean())


def _scanned(seen: Seen, mask: Bools) -> NDArray[np.float32]:
    """The scanned voxels nearest to a mask's."""
    index = np.rint(seen.scanned.to_index(seen.mr.centres(mask))).astype(int)
    index = index[np.all((index >= 0) & (index < seen.scanned.shape), axis=1)]
    return np.asarray(seen.scanned.data[tuple(index.T)])


def _cut_share(seen: Seen, skin: Bools) -> float:
    """Share of the breast's surface that lies on the volume's ends; its back is no part of it."""
    first, last = seen.scanned.origin, seen.scanned.to_world(np.array(seen.scanned.shape) - 1)
    cut = 0
    for axis in range(3):
        for end, outer in ((0, first), (-1, last)):
            index = 0 if end == 0 else seen.mr.shape[axis] - 1
            place = seen.mr.origin[axis] + seen.mr.spacing[axis] * index
            if abs(place - outer[axis]) < 1.5 * max(seen.mr.spacing[axis], seen.scanned.spacing[axis]):
                cut += int(np.take(seen.breast, end, axis=axis).sum())
    return cut / max(cut + int(skin.sum()), 1)


def _text(value: float, unit: str) -> str:
    return f"{value:.2g}" if unit == "1" else f"{value:.0f} {unit}" if value >= 100.0 else f"{value:.2g} {unit}"


def _span(low: float, high: float, unit: str) -> str:
    if not np.isfinite(low):
        return f"at most {_text(high, unit)}"
    return f"at least {_text(low, unit)}" if not np.isfinite(high) else f"{_text(low, '1')} to {_text(high, unit)}"
