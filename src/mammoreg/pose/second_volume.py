"""A view made from the mask of a second MR volume: what a mammogram by parallel beams would show of its outline."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import find_contours

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, Volume, breast_to_plate
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.plates import PlatePair
from mammoreg.pose.silhouette import pixels_at_detector

PARALLEL_MM = 1.0e7  # a source this far away casts parallel beams
PIXEL_MM = 0.7
FADE_MM = 10.0


def parallel_view(mask: Volume, plates: PlatePair) -> ViewGeometry:
    """Geometry of a parallel projection along the compression, wide enough for the mask in front of the edge."""
    points = breast_to_plate(mask.centres(mask.data > 0), plates.angle_deg)
    front = points[points[:, 1] < plates.edge_p_mm]
    if not len(front):
        raise DataError("the second MR volume shows no tissue in front of the plates' chest-wall edge")
    low, high = front[:, 0].min() - FADE_MM, front[:, 0].max() + FADE_MM
    depth = plates.edge_p_mm - front[:, 1].min() + FADE_MM
    return ViewGeometry(
        angle_deg=plates.angle_deg,
        edge_p_mm=plates.edge_p_mm,
        middle_mm=0.5 * float(low + high),
        height_mm=plates.lower_mm,
        thickness_mm=plates.thickness_mm,
        source_detector_mm=PARALLEL_MM,
        support_detector_mm=0.0,
        pixel_mm=PIXEL_MM,
        rows=int(np.ceil((high - low) / PIXEL_MM)),
        columns=int(np.ceil(depth / PIXEL_MM)),
    )


def silhouette_mask(mask: Volume, view: ViewGeometry) -> NDArray[np.float64]:
    """Shadow (rows, columns) in [0, 1] of the mask between the plates; 0.5 is the outline."""
    row, column = np.mgrid[0 : view.rows, 0 : view.columns]
    heights = np.arange(view.height_mm, view.height_mm + view.thickness_mm, float(mask.spacing.min()))
    smooth = mask.with_data(ndimage.gaussian_filter(mask.data.astype(np.float32), 0.7))
    shadow = np.zeros((view.rows, view.columns))
    pixels = np.stack([column, row], axis=-1).astype(float)
    turn = breast_to_plate(np.eye(3), view.angle_deg)
    for height in heights:
        plate_points = view.back_project(pixels, np.full(row.shape, height))
        shadow = np.maximum(shadow, smooth.sample(plate_points @ turn.T))
    return shadow


def outline_of_mask(mask: Volume, view: ViewGeometry, theta: NDArray[np.float64]) -> RadialOutline:
    """Outline of the second volume's mask along the compression; trust fades over 10 mm before the plates' edge.

    Raises:
        DataError: the mask has no outline in front of the plates' edge.
    """
    shadow = silhouette_mask(mask, view)
    labels, count = ndimage.label(shadow > 0.5)
    if count == 0:
        raise DataError("the second MR volume shows no breast between the plates")
    largest = 1 + int(np.argmax(ndimage.sum_labels(shadow > 0.5, labels, np.arange(1, count + 1))))
    kept = np.where((labels == largest) | (shadow <= 0.5), shadow, 0.0)
    contour = max(find_contours(np.pad(kept, ((1, 1), (0, 1))), 0.5), key=len) - np.array([1.0, 0.0])
    points = pixels_at_detector(contour[:, ::-1], view)
    if points[0, 1] > points[-1, 1]:
        points = points[::-1]
    return radial_outline(points, np.clip(points[:, 0] / FADE_MM, 0.0, 1.0), theta)
