"""Compression plates found in the mask of a second MR volume, taken between the plates.

The plates show as two parallel flat faces of the body's outline. Only the mask is read, no
intensities: tilt, heights, and the posterior end of the flat faces, where the plates end.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import marching_cubes

from mammoreg.arrays import Points
from mammoreg.errors import DataError
from mammoreg.geometry import Volume, breast_to_plate

SMOOTHING_VOXELS = 0.8
FACING = 0.96  # cosine of the largest angle (16 degrees) between a plate's normal and a facet that lies on it
FLATNESS_MM = 1.0  # half width of the layer that counts as lying on a plate
OVERHANG_MM = 3.0  # tissue this far outside the gap has left the plates
BORDER_VOXELS = 3  # a cut through the body at the border of the grid is no plate
TILTS_DEG = np.arange(-15.0, 15.01, 0.5)
MIN_CONTACT_MM2 = 100.0
DISTINCT = 1.3  # flat faces stand out among the tilts; a round body looks alike at all of them


@dataclass(frozen=True)
class PlatePair:
    """Two parallel plates in the plate frame.

    Attributes:
        angle_deg: tilt of the plates about the posterior axis.
        lower_mm, upper_mm: heights of the two surfaces.
        edge_p_mm: posterior coordinate of the plates' chest-wall edge, behind which tissue bulges out of the gap.
        contact_mm2: area of the lower and the upper flat face.
    """

    angle_deg: float
    lower_mm: float
    upper_mm: float
    edge_p_mm: float
    contact_mm2: tuple[float, float]

    @property
    def thickness_mm(self) -> float:
        """Plate gap."""
        return self.upper_mm - self.lower_mm


@dataclass(frozen=True)
class _Surface:
    centre: Points
    normal: Points
    area: NDArray[np.float64]


def find_plates(mask: Volume) -> PlatePair:
    """Find the plates in a body mask (breast frame, 0/1).

    Raises:
        DataError: the mask has no two parallel flat faces of at least 1 cm2.
    """
    surface = _facets(mask)
    scores = np.array([_contact_score(surface, tilt) for tilt in TILTS_DEG])
    near = scores > 0.9 * scores.max()  # the maximum is broad; its middle is steadier than its top
    angle = float(np.average(TILTS_DEG[near], weights=scores[near]))
    turned = breast_to_plate(surface.centre, angle)
    facing = breast_to_plate(surface.normal, angle)[:, 2]
    lower, area_low = _flat_face(turned[:, 2], surface.area * (facing < -FACING))
    upper, area_up = _flat_face(turned[:, 2], surface.area * (facing > FACING))
    distinct = scores.max() > DISTINCT * np.median(scores)
    if min(area_low, area_up) < MIN_CONTACT_MM2 or upper <= lower or not distinct:
        raise DataError(
            "the second MR volume shows no two parallel flat faces of a breast between plates; "
            "give a volume taken under compression or leave `mr_compressed` empty"
        )
    return PlatePair(angle, lower, upper, _edge(mask, angle, lower, upper), (area_low, area_up))


def _facets(mask: Volume) -> _Surface:
    smooth = ndimage.gaussian_filter(mask.data.astype(np.float32), SMOOTHING_VOXELS, mode="nearest")
    vertices, faces, _, _ = marching_cubes(smooth, 0.5, spacing=tuple(mask.spacing), gradient_direction="ascent")
    corners = vertices[faces] + mask.origin
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    inside = (vertices > BORDER_VOXELS * mask.spacing) & (
        vertices < (np.array(mask.shape) - 1 - BORDER_VOXELS) * mask.spacing
    )
    keep = (length > 0) & inside.all(axis=1)[faces].all(axis=1)
    normal = cross[keep] / length[keep, None]
    return _Surface(corners.mean(axis=1)[keep], normal, 0.5 * length[keep])


def _contact_score(surface: _Surface, tilt: float) -> float:
    height = breast_to_plate(surface.centre, tilt)[:, 2]
    facing = breast_to_plate(surface.normal, tilt)[:, 2]
    areas = [_flat_face(height, surface.area * (sign * facing > FACING))[1] for sign in (-1.0, 1.0)]
    return float(np.sqrt(areas[0] * areas[1]))


def _flat_face(height: NDArray[np.float64], weight: NDArray[np.float64]) -> tuple[float, float]:
    step = 0.25
    low = float(height.min())
    histogram = np.bincount(((height - low) / step).astype(int), weights=weight)
    window = int(2 * FLATNESS_MM / step) + 1
    mass = ndimage.uniform_filter1d(histogram, window, mode="constant") * window
    centre = low + (int(np.argmax(mass)) + 0.5) * step
    for _ in range(3):
        on = (np.abs(height - centre) < FLATNESS_MM) & (weight > 0)
        if not on.any():
            return centre, 0.0
        centre = float(np.average(height[on], weights=weight[on]))
    return centre, float(weight[on].sum())


def _edge(mask: Volume, angle: float, lower: float, upper: float) -> float:
    """Most anterior tissue outside the gap: it hangs over the plates' chest-wall edge."""
    points = breast_to_plate(mask.centres(mask.data > 0), angle)
    over = (points[:, 2] > upper + OVERHANG_MM) | (points[:, 2] < lower - OVERHANG_MM)
    if not over.any():
        return float(points[:, 1].max())
    return float(np.quantile(points[over, 1], 0.002))
