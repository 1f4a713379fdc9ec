"""Into a compressed MR volume: placing a surface by that volume's outline, never by its intensities."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize
from scipy.spatial.transform import Rotation

from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Points
from mammoreg.localization.deformation import AffineDeformation

_ROBUST_MM = 2.0


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


def fit_surface_to_outline(surface: Points, outline: Volume, *, rotate: bool) -> AffineDeformation:
    """The rigid motion that lays a surface best on a body's outline.

    The distances between the surface's points and the outline are minimised with a soft L1 loss (scale 2 mm), because
    a deformed breast does not fit everywhere.

    Args:
        surface: points (N, 3) on the skin, mm, in the outline's frame and near their place.
        outline: `signed_distance` of the body, of which the chest may be part.
        rotate: let the surface turn about its centroid too, not only shift.
    """
    middle = surface.mean(axis=0)
    last = np.array(outline.shape) - 1

    def motion(parameters: NDArray[np.float64]) -> AffineDeformation:
        turn = Rotation.from_rotvec(parameters[3:]).as_matrix() if rotate else np.eye(3)
        return AffineDeformation(turn, middle + parameters[:3] - turn @ middle)

    def misfit(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        index = outline.to_index(motion(parameters).forward(surface))
        held = np.clip(index, 0, last)
        beyond = np.linalg.norm((index - held) * outline.spacing, axis=1)
        return np.asarray(outline.sample(outline.to_world(held)) + beyond, dtype=float)

    start = np.zeros(6 if rotate else 3)
    scale = np.array([1.0] * 3 + [0.02] * (len(start) - 3))
    found = optimize.least_squares(misfit, start, loss="soft_l1", f_scale=_ROBUST_MM, x_scale=scale, xtol=1e-6)
    return motion(found.x)
