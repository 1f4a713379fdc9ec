"""Dense tissue of model and mammogram compared inside the breast: what an outline cannot tell about the angle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.imaging.correlation import correlation
from mammoreg.pose.silhouette import detector_mm

PIXEL_MM = 2.0
FINE_MM = 2.0  # chosen: smoothing of both images before they are compared
COARSE_MM = 14.0  # chosen: structure wider than this is thickness, not gland
RIM_MM = 10.0  # chosen: thickness changes too fast within this distance from the edge of the breast
MIN_PIXELS = 200


@dataclass(frozen=True)
class DensityImage:
    """Structure of dense tissue on a coarse detector grid, (rows, columns), forward along columns.

    Attributes:
        structure: zero-mean structure inside the mask.
        mask: where it is meaningful.
        pixel_mm: pixel of the grid at the detector.
    """

    structure: NDArray[np.float64]
    mask: NDArray[np.bool_]
    pixel_mm: float


def mammogram_structure(pixels: NDArray[np.float32], mask: NDArray[np.bool_], pixel_mm: float) -> DensityImage:
    """Structure of a canonical mammogram (rows, columns), bright = dense; `mask` is breast without pectoral muscle."""
    factor = max(1, round(PIXEL_MM / pixel_mm))
    rows, columns = (n // factor for n in pixels.shape)
    crop = (slice(0, rows * factor), slice(0, columns * factor))
    blocks = pixels[crop].reshape(rows, factor, columns, factor).mean(axis=(1, 3))
    inside = mask[crop].reshape(rows, factor, columns, factor).mean(axis=(1, 3)) > 0.99
    return _structure(blocks.astype(float), inside, factor * pixel_mm)


def projected_structure(
    points: Points, excess: NDArray[np.float64], view: ViewGeometry, shape: tuple[int, int]
) -> DensityImage:
    """Structure of tissue points (N, 3) in the plate frame, whose attenuation exceeds that of fat by `excess` (N,).

    Points are splatted onto the grid of `mammogram_structure`; `shape` is that of its image.
    """
    factor = max(1, round(PIXEL_MM / view.pixel_mm))
    place = detector_mm(points, view) / (factor * view.pixel_mm)
    offset = 0.5 * (view.rows / factor - 1.0)
    column, row = place[:, 0] - 0.5, place[:, 1] + offset
    image = _splat(row, column, excess, shape)
    count = _splat(row, column, np.ones(len(points)), shape)
    full = np.quantile(count[count > 0], 0.9) if (count > 0).any() else 1.0
    return _structure(image, count > 0.2 * full, factor * view.pixel_mm)


def density_correlation(a: DensityImage, b: DensityImage) -> float:
    """Normalised cross-correlation of two structures where both are meaningful; nan where they hardly overlap."""
    both = a.mask & b.mask
    return correlation(a.structure, b.structure, both) if both.sum() >= MIN_PIXELS else float("nan")


def _structure(image: NDArray[np.float64], inside: NDArray[np.bool_], pixel_mm: float) -> DensityImage:
    weight = inside.astype(float)

    def smooth(sigma_mm: float) -> NDArray[np.float64]:
        sigma = sigma_mm / pixel_mm
        total = ndimage.gaussian_filter(weight, sigma)
        return np.asarray(ndimage.gaussian_filter(image * weight, sigma) / np.maximum(total, 1e-6))

    padded = np.pad(inside, ((1, 1), (0, 1)))
    depth = ndimage.distance_transform_edt(padded)[1:-1, :-1] * pixel_mm
    return DensityImage(smooth(FINE_MM) - smooth(COARSE_MM), depth > RIM_MM, pixel_mm)


def _splat(
    row: NDArray[np.float64], column: NDArray[np.float64], value: NDArray[np.float64], shape: tuple[int, int]
) -> NDArray[np.float64]:
    image = np.zeros(shape[0] * shape[1])
    low_row, low_column = np.floor(row).astype(int), np.floor(column).astype(int)
    for dr in (0, 1):
        for dc in (0, 1):
            r, c = low_row + dr, low_column + dc
            share = (1.0 - np.abs(row - r)) * (1.0 - np.abs(column - c))
            keep = (r >= 0) & (r < shape[0]) & (c >= 0) & (c < shape[1])
            image += np.bincount(r[keep] * shape[1] + c[keep], weights=(share * value)[keep], minlength=image.size)
    return image.reshape(shape)
