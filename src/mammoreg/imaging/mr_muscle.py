"""The breast's back where the volume shows no torso: at the muscle's front, or where the volume ends."""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from mammoreg.arrays import Bools, Floats
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_chest_wall import BackSurface

STEP_MM = 3.0
"""The contrast is taken this far in front of and behind the surface."""
MIN_SCORE = 0.2
"""Mean contrast (at most 1) below which no muscle is seen."""


def back_at_muscle(contrast: Volume, body: Bools, apex: Floats, min_depth_mm: float) -> BackSurface:
    """Smooth surface with the breast's tissue in front and muscle behind, or the body's end in the volume.

    Args:
        contrast: +1 where it looks like the breast's tissue, -1 where it looks like muscle, on a coarse grid.
        body: body against air on that grid.
        apex: most anterior point of the breast, mm.
        min_depth_mm: least depth of the surface below the apex.
    """
    columns = np.argwhere(body.any(axis=1))
    m = contrast.origin[0] + contrast.spacing[0] * columns[:, 0]
    s = contrast.origin[2] + contrast.spacing[2] * columns[:, 1]
    centre = np.array([m.mean(), s.mean()])
    end = float(contrast.origin[1] + contrast.spacing[1] * (np.flatnonzero(body.any(axis=(0, 2)))[-1] + 0.5))
    masked = np.where(body, contrast.data, 0.0).astype(np.float32)

    def score(coefficients: Floats) -> float:
        p = BackSurface(centre, coefficients).posterior(m, s)
        return float(np.mean(_at(contrast, masked, m, p - STEP_MM, s) - _at(contrast, masked, m, p + STEP_MM, s))) / 2.0

    depths = np.arange(apex[1] + min_depth_mm, end, 2.0)
    slopes = (-0.2, -0.1, 0.0, 0.1, 0.2)
    trials = [np.array([p, a, b, 0.0, 0.0]) for p, a, b in itertools.product(depths, slopes, slopes)]
    best: Floats | None = max(trials, key=score, default=None)
    if best is None or score(best) < MIN_SCORE:
        return BackSurface(centre, np.array([end - contrast.spacing[1], 0.0, 0.0, 0.0, 0.0]))
    scale = np.array([2.0, 0.05, 0.05, 2e-3, 2e-3])
    simplex = best + np.vstack([np.zeros(5), np.diag(scale)])
    options: Any = {"initial_simplex": simplex, "maxiter": 300}

    def negative(c: Floats) -> float:
        return -score(c)

    found = optimize.minimize(negative, best.tolist(), method="Nelder-Mead", options=options)
    return BackSurface(centre, np.asarray(found.x, dtype=float))


def _at(grid: Volume, data: NDArray[np.float32], m: Floats, p: Floats, s: Floats) -> Floats:
    """Samples at points given by their coordinates, mm; 0 outside the grid."""
    index = [(x - o) / h for x, o, h in zip((m, p, s), grid.origin, grid.spacing, strict=True)]
    return np.asarray(ndimage.map_coordinates(data, index, order=1, mode="constant"), dtype=float)
