"""Summary statistics of distances, as the paper gives them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LIMIT_MM = 5.0


@dataclass(frozen=True)
class Summary:
    """Statistics of distances in mm; all but the counts are None where nothing was measured.

    Attributes:
        n: measured distances.
        of: what has a truth.
        mean_mm, sd_mm, median_mm, max_mm: of the measured ones; the SD is the population's.
        within_5_mm_percent: share of the measured ones up to the paper's limit of 5 mm, included.
        improvement_percent: 100 (1 - mean of distance / rigid distance) over what both measured; with this mean of
            ratios the paper's Tables V and VI give the 78 and 94 % of its section IV. A lucky hit of `rigid` rules it.
        reduction_percent: 100 (1 - mean distance / mean rigid distance) over the same; not the paper's.
        compared: what both measured.
    """

    n: int
    of: int
    mean_mm: float | None = None
    sd_mm: float | None = None
    median_mm: float | None = None
    max_mm: float | None = None
    within_5_mm_percent: float | None = None
    improvement_percent: float | None = None
    reduction_percent: float | None = None
    compared: int | None = None


def summarise(distances: Sequence[float | None], rigid: Sequence[float | None] | None = None) -> Summary:
    """Summarise distances in mm, None where there is a truth but no prediction.

    Args:
        distances: one per measurement.
        rigid: the method `rigid` on the same measurements, for the improvement.
    """
    found = np.array([d for d in distances if d is not None], dtype=float)
    if not len(found):
        return Summary(0, len(distances))
    improvement, reduction, compared = _against_rigid(distances, rigid) if rigid is not None else (None, None, None)
    return Summary(
        len(found),
        len(distances),
        float(found.mean()),
        float(found.std()),
        float(np.median(found)),
        float(found.max()),
        100.0 * float(np.mean(found <= LIMIT_MM)),
        improvement,
        reduction,
        compared,
    )


def _against_rigid(
    distances: Sequence[float | None], rigid: Sequence[float | None]
) -> tuple[float | None, float | None, int]:
    """Mean of ratios and ratio of means as improvements in percent, and over how many pairs."""
    pairs = np.array([(d, r) for d, r in zip(distances, rigid, strict=True) if d is not None and r is not None])
    if not len(pairs) or not pairs[:, 1].any():
        return None, None, len(pairs)
    mine, theirs = pairs.T
    ratios = mine[theirs > 0.0] / theirs[theirs > 0.0]
    return 100.0 * (1.0 - float(ratios.mean())), 100.0 * (1.0 - float(mine.mean() / theirs.mean())), len(pairs)
