"""Into a compressed MR volume: placing a surface by that volume's outline, never by its intensities."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import ndimage, optimize
from scipy.spatial.transform import Rotation

from mammoreg.arrays import Floats, Points
from mammoreg.geometry import Volume, plate_to_breast
from mammoreg.localization.deformation import AffineDeformation, MethodView

_ROBUST_MM = 2.0
_RIGID_BASE_MM = 1.0  # about a voxel of the working grid
_TURN_RAD = 0.02  # moves a breast's skin about as far as 1 mm does


@dataclass(frozen=True)
class SecondVolume:
    """The compressed volume as what is placed in it knows it, breast frame, mm.

    Attributes:
        mask: the body between the plates.
        skin: points (N, 3) on the undeformed skin.
        base_mm: of `fit_surface_to_outline`, for the shift.
    """

    mask: Volume
    skin: Points
    base_mm: float | None = None

    @cached_property
    def outline(self) -> Volume:
        """Signed distance from the body's surface."""
        return signed_distance(self.mask)

    def rigid(self, points: Points) -> Points:
        """Points (N, 3) of the undeformed breast by the best rigid fit of its skin."""
        return fit_surface_to_outline(self.skin, self.outline, rotate=True, base_mm=_RIGID_BASE_MM).forward(points)

    def place(self, way: MethodView, drawn_mm: Points, points: Points) -> Points:
        """Points (N, 3) of the undeformed breast where a method and the mask put them."""
        return drawn_to_breast(way, drawn_mm, points) + self.shift(way, drawn_mm)

    def shift(self, way: MethodView, drawn_mm: Points) -> Points:
        """Displacement (3,) by which the mask places what a method has deformed."""
        surface = drawn_to_breast(way, drawn_mm, self.skin)
        return fit_surface_to_outline(surface, self.outline, rotate=False, base_mm=self.base_mm).offset


def drawn_to_breast(way: MethodView, drawn: Points, points: Points) -> Points:
    """Points (N, 3) of the undeformed breast between the plates, breast frame, from where the breast was drawn to."""
    return plate_to_breast(way.deformation.forward(points) + np.asarray(drawn), way.geometry.angle_deg)


def signed_distance(mask: Volume) -> Volume:
    """Distance in mm from each voxel's centre to the mask's surface, negative inside; the grid's border is no surface.

    Raises:
        ValueError: if the mask is empty or full.
    """
    body = np.asarray(mask.data) != 0
    if not body.any() or body.all():
        raise ValueError("a mask that is empty or full has no surface")
    outside = ndimage.distance_transform_edt(~body, sampling=mask.spacing)
    inside = ndimage.distance_transform_edt(body, sampling=mask.spacing)
    half = 0.5 * float(np.mean(mask.spacing))
    return mask.with_data(np.where(body, half - inside, outside - half))


def fit_surface_to_outline(
    surface: Points, outline: Volume, *, rotate: bool, base_mm: float | None = None
) -> AffineDeformation:
    """The rigid motion that lays a surface best on a body's outline.

    The distances between the surface's points and the outline are minimised with a soft L1 loss (scale 2 mm), because
    a deformed breast does not fit everywhere. A rotation is sought from the best shift and from the surface's own
    place, and kept only where it lowers that loss by more than what rounding to voxels makes of it.

    Args:
        surface: points (N, 3) on the skin, mm, in the outline's frame and near their place.
        outline: `signed_distance` of the body, of which the chest may be part.
        rotate: let the surface turn about its centroid too, not only shift.
        base_mm: half the distance over which slopes are taken; None: as short as rounding allows. Distances on voxels
            have kinks, at which a fit by such short slopes stops early: a shift by some tenths of a millimetre, a
            rotation by degrees.
    """
    middle = surface.mean(axis=0)
    last = np.array(outline.shape) - 1

    def motion(parameters: Floats) -> AffineDeformation:
        turn = Rotation.from_rotvec(parameters[3:]).as_matrix() if len(parameters) > 3 else np.eye(3)
        return AffineDeformation(turn, middle + parameters[:3] - turn @ middle)

    def misfit(parameters: Floats) -> Floats:
        index = outline.to_index(motion(parameters).forward(surface))
        held = np.clip(index, 0, last)
        beyond = np.linalg.norm((index - held) * outline.spacing, axis=1)
        return np.asarray(outline.sample(outline.to_world(held)) + beyond, dtype=float)

    shifted = _least(misfit, np.zeros(3), base_mm, 1e-6)
    if not rotate:
        return motion(shifted.x)
    starts = (np.concatenate([shifted.x, np.zeros(3)]), np.zeros(6))
    turned = min((_least(misfit, start, base_mm, 1e-4) for start in starts), key=lambda found: float(found.cost))
    rounding = 0.5 * len(surface) * float(np.mean(outline.spacing**2)) / 12.0
    return motion(turned.x if turned.cost < shifted.cost - rounding else shifted.x)


def _least(misfit: Callable[[Floats], Floats], start: Floats, base_mm: float | None, settled: float) -> Any:
    """Least soft L1 loss of distances over a shift, mm, and a rotation vector, rad, from a start (3,) or (6,)."""
    scale = np.array([1.0] * 3 + [_TURN_RAD] * (len(start) - 3))
    slopes: Any = "2-point" if base_mm is None else _central_slopes(misfit, base_mm * scale)
    return optimize.least_squares(
        misfit, start, slopes, loss="soft_l1", f_scale=_ROBUST_MM, x_scale=scale, xtol=settled
    )


def _central_slopes(function: Callable[[Floats], Floats], steps: Floats) -> Callable[[Floats], Floats]:
    """Derivative (N, P) of a function of P parameters by differences over the steps (P,)."""

    def slopes(parameters: Floats) -> Floats:
        shifts = np.diag(steps)
        differences = [function(parameters + shift) - function(parameters - shift) for shift in shifts]
        return np.asarray(np.stack(differences, axis=-1) / (2.0 * steps))

    return slopes
