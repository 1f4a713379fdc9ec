"""The pectoral muscle in an MLO view: bright, in the posterior upper corner, behind a nearly straight edge."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mammoreg.arrays import Floats32

# All chosen.
_GRID_MM = 1.0  # of the reduced image
_STEP_MM = 3.0  # on either side of an edge, between which brightness drops
_NORMAL_DEG = np.arange(8.0, 66.0, 2.0)  # directions tried, from the chest wall's normal
_LEAST_LENGTH_MM = 25.0
_LEAST_CONTRAST_SHARE = 0.12  # mean drop, of the breast's range of brightness
_LEAST_CONSISTENCY = 0.85  # of the edge's points must be brighter behind it
_RIM_MM = 10.0  # from the skin, where brightness falls off anyway
_LARGEST_SHARE = 0.45  # of the breast behind the edge at most
_BAND_MM = 8.0  # within which the straight edge is bent
_BEND_COST = 0.15  # of one pixel of bend, in units of the largest drop


def pectoral_mask(pixels: Floats32, mask: NDArray[np.bool_], pixel_mm: float) -> NDArray[np.bool_] | None:
    """Mask of the pectoral muscle in a canonical MLO image, or None where no consistent edge is found.

    A straight edge with the largest mean drop of brightness away from the corner is searched, then bent to the image
    by a shortest path within 8 mm of it.

    Args:
        pixels: canonical image (rows, columns).
        mask: breast mask of the same shape.
        pixel_mm: pixel spacing in mm.
    """
    factor = max(1, round(_GRID_MM / pixel_mm))
    grid_mm = factor * pixel_mm
    coarse = np.asarray(ndimage.gaussian_filter(_block_mean(pixels, factor), 1.0 / grid_mm), dtype=np.float32)
    inside = _block_mean(mask.astype(np.float32), factor) > 0.5
    line = _best_line(coarse, inside, _away_from_skin(inside, grid_mm), grid_mm)
    if line is None:
        return None
    corner = _behind_bent_edge(coarse, inside, line, grid_mm)
    rows, columns = (np.minimum(np.arange(n) // factor, m - 1) for n, m in zip(mask.shape, corner.shape, strict=True))
    return np.asarray(corner[np.ix_(rows, columns)] & mask, dtype=bool)


def _block_mean(image: Floats32, factor: int) -> Floats32:
    rows, columns = (n - n % factor for n in image.shape)
    blocks = image[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)


def _line_points(normal: NDArray[np.float64], offset: float, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Points (N, 2) of (column, row), one pixel apart, of a line n.x = offset inside an image."""
    tangent = np.array([normal[1], -normal[0]])
    reach = float(np.hypot(*shape))
    points = offset * normal + np.arange(-reach, reach)[:, None] * tangent
    kept = (points[:, 0] >= 0) & (points[:, 0] <= shape[1] - 1) & (points[:, 1] >= 0) & (points[:, 1] <= shape[0] - 1)
    return np.asarray(points[kept], dtype=float)


def _sample(image: NDArray[np.float32], points: NDArray[np.float64]) -> NDArray[np.float64]:
    values = ndimage.map_coordinates(image, [points[..., 1], points[..., 0]], order=1, mode="nearest")
    return np.asarray(values, dtype=float)


def _away_from_skin(inside: NDArray[np.bool_], grid_mm: float) -> NDArray[np.bool_]:
    """Where brightness does not fall off because the breast ends; image borders are no skin."""
    padded = np.pad(inside, 1, mode="edge")
    return np.asarray(ndimage.distance_transform_edt(padded)[1:-1, 1:-1] * grid_mm > _RIM_MM, dtype=bool)


def _best_line(
    image: Floats32, inside: NDArray[np.bool_], deep: NDArray[np.bool_], grid_mm: float
) -> tuple[NDArray[np.float64], float] | None:
    """Normal (2,) and offset of the line with the largest drop of brightness away from the upper posterior corner."""
    rows, across = np.indices(image.shape)
    reach = float(np.ptp(np.percentile(image[inside], (5, 95))))
    best: tuple[float, NDArray[np.float64], float] | None = None
    for degrees in _NORMAL_DEG:
        normal = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
        last = np.quantile((across * normal[0] + rows * normal[1])[inside], _LARGEST_SHARE)
        for offset in np.arange(5.0, last, 1.0):
            score = _line_score(image, deep, normal, offset, grid_mm, reach)
            if score is not None and (best is None or score > best[0]):
                best = (score, normal, float(offset))
    return None if best is None else (best[1], best[2])


def _line_score(
    image: Floats32, deep: NDArray[np.bool_], normal: NDArray[np.float64], offset: float, grid_mm: float, reach: float
) -> float | None:
    points = _line_points(normal, offset, image.shape)
    step = _STEP_MM / grid_mm * normal
    points = points[_sample(deep.astype(np.float32), points + step) > 0.5] if len(points) else points
    # The edge must leave the image at its chest wall, or its upper part, as a muscle's does.
    if len(points) * grid_mm < _LEAST_LENGTH_MM or points[:, 0].min() > 5.0 / grid_mm:
        return None
    drop = _sample(image, points - step) - _sample(image, points + step)
    contrast = float(np.mean(np.clip(drop, -0.3 * reach, 0.3 * reach)))
    if contrast < _LEAST_CONTRAST_SHARE * reach or np.mean(drop > 0.0) < _LEAST_CONSISTENCY:
        return None
    return contrast * float(np.sqrt(min(len(points) * grid_mm, 100.0)))


def _behind_bent_edge(
    image: Floats32, inside: NDArray[np.bool_], line: tuple[NDArray[np.float64], float], grid_mm: float
) -> NDArray[np.bool_]:
    normal, offset = line
    points = _line_points(normal, offset, image.shape)
    band = np.arange(-round(_BAND_MM / grid_mm), round(_BAND_MM / grid_mm) + 1)
    grid = points[:, None, :] + band[None, :, None] * normal
    step = _STEP_MM / grid_mm * normal
    drop = _sample(image, grid - step) - _sample(image, grid + step)
    drop[_sample(inside.astype(np.float32), grid + step) < 0.5] = 0.0
    shift = band[_smoothest_path(drop / max(float(drop.max()), 1e-9))]
    return _behind(points, np.asarray(shift, dtype=float), normal, offset, image.shape)


def _smoothest_path(gain: NDArray[np.float64]) -> NDArray[np.int64]:
    """Column index (N,) of the path through a gain (N, K) that maximises gain less bending."""
    steps = np.abs(np.arange(gain.shape[1])[:, None] - np.arange(gain.shape[1])[None, :])
    cost = np.where(steps <= 2, _BEND_COST * steps, np.inf)
    total, came = gain[0].copy(), np.zeros(gain.shape, dtype=np.int64)
    for row in range(1, len(gain)):
        options = total[:, None] - cost
        came[row] = np.argmax(options, axis=0)
        total = options[came[row], np.arange(gain.shape[1])] + gain[row]
    path = [int(np.argmax(total))]
    for row in range(len(gain) - 1, 0, -1):
        path.append(int(came[row, path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _behind(
    points: NDArray[np.float64],
    shift: NDArray[np.float64],
    normal: NDArray[np.float64],
    offset: float,
    shape: tuple[int, int],
) -> NDArray[np.bool_]:
    tangent = np.array([normal[1], -normal[0]])
    rows, columns = np.indices(shape)
    along = columns * tangent[0] + rows * tangent[1]
    across = columns * normal[0] + rows * normal[1]
    smooth_shift = ndimage.gaussian_filter1d(shift, 3.0, mode="nearest")
    bent = np.interp(along, points @ tangent, smooth_shift)
    return np.asarray(across < offset + bent, dtype=bool)
