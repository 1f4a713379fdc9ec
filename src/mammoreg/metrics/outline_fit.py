"""How well a model's silhouette meets the outline in a mammogram."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.pose.outline import RadialOutline
from mammoreg.pose.silhouette import Silhouette

_FULL = 0.999


@dataclass(frozen=True)
class OutlineFit:
    """Misfit of a silhouette.

    Attributes:
        mean_mm, p95_mm: distance along the outline's normal, at the detector, weighted by the outline's length; only
            where the outline is skin and fully trusted and meets the model's skin, None where it nowhere does.
        dice: of the areas in front of the chest-wall edge, on the rays on which both show skin.
    """

    mean_mm: float | None
    p95_mm: float | None
    dice: float | None


def outline_fit(outline: RadialOutline, model: Silhouette, rim: NDArray[np.bool_]) -> OutlineFit:
    """Compare a silhouette with the outline on the same rays.

    Where the silhouette runs along the model's `rim`, a mark (N,) of its nodes, the model ends and skin does not.
    """
    gap, skin = np.abs(outline.normal_gap(model)), ~model.between(rim)
    trusted = (outline.weight >= _FULL) & np.isfinite(gap) & skin
    both = np.isfinite(outline.radius) & np.isfinite(model.radius) & skin
    true, found = outline.radius[both] ** 2, model.radius[both] ** 2
    dice = float(2.0 * np.minimum(true, found).sum() / (true + found).sum()) if both.any() else None
    if not trusted.any():
        return OutlineFit(None, None, dice)
    length = np.linalg.norm(np.gradient(outline.points(), axis=0), axis=1)[trusted]
    length = np.where(np.isfinite(length), length, 0.0)
    return OutlineFit(*_weighted(gap[trusted], length), dice)


def _weighted(values: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Weighted mean and 95th percentile."""
    order = np.argsort(values)
    cumulated = np.cumsum(weight[order]) / weight.sum()
    return float(values @ weight / weight.sum()), float(np.interp(0.95, cumulated, values[order]))
