"""The breast's back: a smooth surface p = f(m, s) where it stands on the chest."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mammoreg.arrays import Floats
from mammoreg.errors import DataError
from mammoreg.geometry import Volume
from mammoreg.imaging.mr_corners import base_corners


@dataclass(frozen=True)
class BackSettings:
    """Choices for the back of the breast.

    Attributes:
        forward_share: how far it lies in front of the corners between breast and chest, share of their depth.
        long_mm: breasts up to this depth are modelled whole, whatever mammograms show.
        imaged_mm: how far mammograms show the breast before their chest-wall edge; inf: unknown.
        behind_edge_mm: how much further back a longer one is modelled.
        min_depth_mm: a breast that stands out less is refused.
        default_tilt, max_tilt: dp/d(-m), mm per mm, where no lateral corner is found, and at most.
        upper_bend, lower_bend: share of the half height over which it bends forward.
        upper_rise, lower_rise: rise of the bends, share of the depth.
    """

    forward_share: float = 0.05
    long_mm: float = 120.0  # chosen: few breasts are deeper
    imaged_mm: float = np.inf
    behind_edge_mm: float = 20.0  # chosen: what the plates' lips press and draw in
    min_depth_mm: float = 20.0
    default_tilt: float = 0.15  # chosen: a back without a lateral corner leans as a rounded chest does
    max_tilt: float = 0.25  # chosen: a steeper lateral corner belongs to the arm
    upper_bend: float = 0.6  # chosen: the breast goes over into the torso long before its top
    lower_bend: float = 0.35  # chosen: the fold below is narrower
    upper_rise: float = 0.5  # chosen: the front of the torso lies halfway to the apex there
    lower_rise: float = 0.15  # chosen: the fold is shallow


@dataclass(frozen=True)
class Bend:
    """A forward bend along s, mm: from nothing at `start` as a parabola to `rise` at `end`, straight on beyond."""

    start: float
    end: float
    rise: float

    def forward(self, s: Floats) -> Floats:
        """How far the surface has come forward at s, mm."""
        u = (s - self.start) / (self.end - self.start)
        return self.rise * np.where(u < 0.0, 0.0, np.where(u < 1.0, u**2, 2.0 * u - 1.0))


@dataclass(frozen=True)
class BackSurface:
    """Back of the breast in the breast frame, mm: a quadratic in (m, s) about a centre, less its forward bends.

    Attributes:
        centre: (m, s) about which the polynomial is written.
        coefficients: of 1, m, s, m2, s2.
        bends: above and below, where the breast goes over into the torso.
    """

    centre: Floats
    coefficients: Floats
    bends: tuple[Bend, ...] = ()

    def posterior(self, m: Floats, s: Floats) -> Floats:
        """Posterior coordinate at medial and superior coordinates, mm."""
        x, z = m - self.centre[0], s - self.centre[1]
        c = self.coefficients
        p = c[0] + c[1] * x + c[2] * z + c[3] * x**2 + c[4] * z**2
        return np.asarray(p - sum(bend.forward(s) for bend in self.bends), dtype=float)


def back_before_chest(body: Volume, apex: Floats, settings: BackSettings) -> BackSurface | None:
    """The back just in front of the corners between breast and chest, bent forward above and below.

    Args:
        body: 1 in the body, 0 in air, on a coarse grid of the breast frame.
        apex: most anterior point of the breast, mm.
        settings: its choices.

    Returns None if the breast has no corner with the chest: the volume shows no torso.

    Raises:
        DataError: the breast is too flat to be told from the chest.
    """
    lateral, medial = base_corners(body, apex)
    if medial is None:
        return None
    slope = settings.default_tilt if lateral is None else (medial[1] - lateral[1]) / (lateral[0] - medial[0])
    tilt = -float(np.clip(slope, 0.0, settings.max_tilt))
    base = min(corner[1] - tilt * (corner[0] - apex[0]) for corner in (lateral, medial) if corner is not None)
    depth = _modelled_depth((1.0 - settings.forward_share) * float(base - apex[1]), settings)
    if depth < settings.min_depth_mm:
        raise DataError(f"the breast stands only {depth:.0f} mm out from the chest: check side and field of view")
    low, high = _half_depth_extent(body, apex, float(apex[1]) + 0.5 * depth, tilt)
    half = 0.5 * (high - low)
    upper = Bend(high - settings.upper_bend * half, high, settings.upper_rise * depth)
    lower = Bend(low + settings.lower_bend * half, low, settings.lower_rise * depth)
    coefficients = np.array([apex[1] + depth, tilt, 0.0, 0.0, 0.0])
    return BackSurface(np.array([apex[0], 0.5 * (low + high)]), coefficients, (upper, lower))


def _modelled_depth(whole: float, settings: BackSettings) -> float:
    """Depth of the model below the apex, mm: to the chest; of a long breast as deep as its mammograms need."""
    return min(whole, max(settings.long_mm, settings.imaged_mm + settings.behind_edge_mm))


def _half_depth_extent(body: Volume, apex: Floats, p: float, tilt: float) -> tuple[float, float]:
    """Lowest and highest s, mm, of the body's section by the tilted plane through (apex m, p) near the apex."""
    m = body.origin[0] + body.spacing[0] * np.arange(body.shape[0])
    plane = np.rint((p + tilt * (m - apex[0]) - body.origin[1]) / body.spacing[1]).astype(int)
    section = body.data[np.arange(body.shape[0]), np.clip(plane, 0, body.shape[1] - 1)] > 0.5
    opened = ndimage.binary_opening(section, iterations=max(int(6.0 / body.spacing[0]), 1))
    label, count = ndimage.label(opened)
    if count == 0:
        raise DataError("the breast is too thin for a model: check side and field of view")
    index = np.rint(body.to_index(apex)).astype(int)[[0, 2]]
    distance = np.where(label > 0, np.hypot(*(np.indices(label.shape) - index[:, None, None])), np.inf)
    rows = np.flatnonzero((label == label.flat[int(np.argmin(distance))]).any(axis=0))
    low, high = body.origin[2] + body.spacing[2] * rows[[0, -1]]
    return float(low), float(high)
