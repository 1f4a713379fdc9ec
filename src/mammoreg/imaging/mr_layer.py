"""How far behind the model's back the pectoral muscle begins, where the volume shows it."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from mammoreg.arrays import Bools, Floats, Points
from mammoreg.geometry import Volume

SPAN_MM = 6.0
"""The step is taken between means over this length before and behind the surface."""
REACH_MM = 110.0
"""The muscle is sought up to this far behind the back."""
SCALE_MM = 40.0
"""Unit of the surface's coordinates across: its coefficients are millimetres over this length."""
MIN_STEP = 0.2
"""Mean step, natural logarithm of the signals' ratio, below which no muscle is seen; fat to muscle is 0.3 to 0.6."""
MIN_SHARE = 0.6
"""Share of the columns that must step by half of that."""
FIRST_SHARE = 0.8
"""Of surfaces with this share of the best one's step the most anterior is the muscle's; others lie in the chest."""
CLIP = (-0.5, 0.7)
"""A single vessel or bone counts no more than this."""
LEAST_LAYER_MM = 10.0  # chosen: where the back lies on the muscle, the muscle itself shears against the ribs


@dataclass(frozen=True)
class MuscleFront:
    """The smooth surface behind the back across which fat turns into muscle.

    Attributes:
        distance_mm: from the back to it along the posterior axis, median.
        step: mean step of the logarithm of the signal across it.
        shown_share: of the columns behind the back that step.
    """

    distance_mm: float
    step: float
    shown_share: float

    @property
    def shows(self) -> bool:
        """Whether it is the muscle's, and not some other surface."""
        return self.step >= MIN_STEP and self.shown_share >= MIN_SHARE

    @property
    def layer_mm(self) -> float | None:
        """Soft tissue between the back and the chest wall, None where the muscle does not show."""
        return max(self.distance_mm, LEAST_LAYER_MM) if self.shows else None


def muscle_front(grid: Volume, body: Bools, breast: Bools, back: Points, fat_suppressed: bool) -> MuscleFront:
    """Find the muscle's front behind the back of a breast.

    A quadratic surface is laid where the signal steps most, on average, from that of fat to that of muscle: up in a
    fat-suppressed volume, down in another. Steps are of logarithms, so that the coil's field drops out.

    Args:
        grid: MR intensities, breast frame.
        body: body against air.
        breast: the breast in front of its back.
        back: points (N, 3) on the back, mm.
        fat_suppressed: whether fat is dark.
    """
    steps, first = _steps(grid, body, breast, back, fat_suppressed)
    across = (back[:, [0, 2]] - back[:, [0, 2]].mean(axis=0)) / SCALE_MM
    basis = np.stack([np.ones(len(back)), *across.T, *(across**2).T], axis=1)
    columns = np.arange(len(back))

    def sampled(p: Floats) -> Floats:
        index = (p - first) / grid.spacing[1]
        found = ndimage.map_coordinates(steps, [columns, index], order=1, mode="constant", prefilter=False)
        return np.where(p > back[:, 1] - 0.5 * SPAN_MM, found, 0.0)

    def negative(coefficients: Floats) -> float:
        return -float(sampled(basis @ coefficients).mean())

    start = _first_trial(steps, (back[:, 1] - first) / grid.spacing[1], basis, float(grid.spacing[1]))
    start[0] += float(np.median(back[:, 1]))
    options: Any = {"initial_simplex": start + np.vstack([np.zeros(5), np.diag([3.0, 4.0, 4.0, 4.0, 3.0])])}
    found = optimize.minimize(negative, start.tolist(), method="Nelder-Mead", options=options | {"maxiter": 400})
    surface = basis @ np.asarray(found.x, dtype=float)
    shown = float((sampled(surface) > 0.5 * MIN_STEP).mean())
    return MuscleFront(float(np.median(surface - back[:, 1])), -float(found.fun), shown)


def _first_trial(steps: NDArray[np.float32], back: Floats, basis: Floats, spacing: float) -> Floats:
    """Coefficients, from the back's median on, of the most anterior trial surface that steps nearly like the best.

    Args:
        steps: (N, P).
        back: faces (N,) at which the back lies.
        basis: (N, 5).
        spacing: of the faces, mm.
    """
    shapes = np.array(
        list(itertools.product((-20.0, -10.0, 0.0, 10.0), (0.0, 8.0, 16.0), (0.0, 8.0, 16.0), (0.0, 6.0)))
    )
    depths = np.arange(0.0, REACH_MM, 3.0)
    forms = float(np.median(back)) + shapes @ basis[:, 1:].T / spacing
    columns, last = np.arange(len(back)), steps.shape[1] - 1
    scores = np.empty((len(depths), len(shapes)))
    for row, depth in enumerate(depths):
        faces = np.rint(forms + depth / spacing).astype(int)
        valid = (faces >= back - 0.5 * SPAN_MM / spacing) & (faces <= last)
        scores[row] = np.where(valid, steps[columns, np.clip(faces, 0, last)], 0.0).mean(axis=1)
    best = scores.max(axis=1)
    row = int(np.argmax(best >= FIRST_SHARE * best.max()))
    while row + 1 < len(best) and best[row + 1] > best[row]:
        row += 1
    return np.array([depths[row], *shapes[int(np.argmax(scores[row]))]])


def _steps(
    grid: Volume, body: Bools, breast: Bools, back: Points, fat_suppressed: bool
) -> tuple[NDArray[np.float32], float]:
    """Step (N, P) towards muscle at the voxels' anterior faces behind each point of the back; the first one's p, mm."""
    index = np.rint(grid.to_index(back)).astype(int)
    low, high = index.min(axis=0), index.max(axis=0) + 1
    start = max(int(low[1] - 2.0 * SPAN_MM / grid.spacing[1]), 0)
    stop = min(int(high[1] + (REACH_MM + SPAN_MM) / grid.spacing[1]), grid.shape[1])
    box = (slice(low[0], high[0]), slice(start, stop), slice(low[2], high[2]))
    at = (index[:, 0] - low[0], slice(None), index[:, 2] - low[2])
    smooth = ndimage.gaussian_filter(grid.data[box], 1.5 / grid.spacing, truncate=3.0)[at]
    inside = body[box][at]
    floor = 0.05 * float(np.median(grid.data[breast]))
    logs = np.where(inside, np.log(np.maximum(smooth, floor)), 0.0)
    reach = round(SPAN_MM / float(grid.spacing[1]))
    before, behind, known = _means(logs, inside, reach)
    rise = (behind - before) * (1.0 if fat_suppressed else -1.0)
    steps = np.clip(np.where(known, rise, 0.0), *CLIP).astype(np.float32)
    return steps, float(grid.origin[1] + grid.spacing[1] * (start - 0.5))


def _means(values: Floats, inside: Bools, reach: int) -> tuple[Floats, Floats, Bools]:
    """Means over `reach` voxels before and behind each face along the last axis, and where both are mostly body."""
    sums, counts = (
        np.concatenate([np.zeros((len(a), 1)), np.cumsum(a, axis=1)], axis=1) for a in (values, inside.astype(float))
    )
    faces = np.arange(sums.shape[1])
    near, far = np.maximum(faces - reach, 0), np.minimum(faces + reach, sums.shape[1] - 1)
    many, more = counts - counts[:, near], counts[:, far] - counts
    before, behind = (sums - sums[:, near]) / np.maximum(many, 1.0), (sums[:, far] - sums) / np.maximum(more, 1.0)
    return before, behind, (many > 0.7 * reach) & (more > 0.7 * reach)
