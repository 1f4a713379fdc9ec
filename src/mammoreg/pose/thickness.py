"""Thickness of the compressed breast where the header does not give it (paper, section II-C)."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.skin import SkinFacets
from mammoreg.pose.alignment import align
from mammoreg.pose.estimate import OUTLINE_FLOOR_MM, OUTLINE_SAMPLES, Compressed
from mammoreg.pose.outline import RadialOutline

SHARES = (0.8, 0.7, 0.6, 0.5, 0.4)
TYPICAL_SHARE = 0.645  # middle of the paper's compressions of 21 % and 50 %
SPREAD = 0.1  # chosen: the paper's two compressions lie one and a half of it to either side
EDGE_PASSES = 2


@dataclass(frozen=True)
class ThicknessEstimate:
    """A plate gap from the outline.

    Attributes:
        thickness_mm: the gap.
        at_bound: whether it is the widest or the narrowest gap tried, so that the outline may ask for more.
    """

    thickness_mm: float
    at_bound: bool


def estimate_thickness(
    view: ViewGeometry,
    outline: RadialOutline,
    compress: Callable[[ViewGeometry], Compressed | None],
    facets: SkinFacets,
    uncompressed_mm: float,
) -> ThicknessEstimate | None:
    """Plate gap at which the compressed breast is as wide as the mammogram shows it.

    The paper takes the thickness from the diameters in MR and mammogram; this compares the whole outline, after a few
    coarse compressions, and leans on the range of the paper's compressions where the outline says little.

    Args:
        view: header's angle, edge and middle to start from; its thickness is not read.
        outline: the mammogram's outline.
        compress: coarse compression at a view's angle, edge and thickness; None where it does not converge.
        facets: skin of the coarse mesh.
        uncompressed_mm: height of the imaged part before compression.

    Returns:
        The estimate, or None where fewer than three compressions converged.
    """
    shares, misfits = [], []
    for share in SHARES:
        state = replace(view, thickness_mm=share * uncompressed_mm)
        rms_mm = None
        for _ in range(EDGE_PASSES):
            compressed = compress(state)
            if compressed is None:
                break
            placed = replace(state, height_mm=compressed.height_mm)
            aligned = align(facets.positions(compressed.nodes), facets.quads, placed, outline)
            state, rms_mm = aligned.view, aligned.rms_mm
        if rms_mm is not None:
            view = replace(view, edge_p_mm=state.edge_p_mm, middle_mm=state.middle_mm)
            shares.append(share)
            misfits.append(
                OUTLINE_SAMPLES * np.log(rms_mm**2 + OUTLINE_FLOOR_MM**2) + ((share - TYPICAL_SHARE) / SPREAD) ** 2
            )
    if len(shares) < 3:
        return None
    share = _least(np.array(shares[::-1]), np.array(misfits[::-1]))
    return ThicknessEstimate(share * uncompressed_mm, share in (shares[0], shares[-1]))


def _least(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Place of the least value by a parabola through the lowest sample and its neighbours, within these."""
    middle = int(np.clip(np.argmin(y), 1, len(x) - 2))
    around = slice(middle - 1, middle + 2)
    bend, slope, _ = np.polyfit(x[around] - x[middle], y[around], 2)
    if bend <= 0.0:
        return float(x[np.argmin(y)])
    return float(np.clip(x[middle] - 0.5 * slope / bend, x[around][0], x[around][-1]))
