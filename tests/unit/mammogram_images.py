"""Synthetic canonical mammograms with known outline, for tests."""

import numpy as np
from numpy.typing import NDArray

PIXEL_MM = 0.25
SHAPE = (640, 400)
DEPTH_MM, HALF_HEIGHT_MM, MIDDLE_ROW = 70.0, 60.0, 330.0


def inside_share(shape: tuple[int, int] = SHAPE, pixel_mm: float = PIXEL_MM) -> NDArray[np.float64]:
    """Normalised elliptical radius of every pixel: 1 on the outline."""
    row, column = np.indices(shape)
    return np.hypot((column + 0.5) * pixel_mm / DEPTH_MM, (row - MIDDLE_ROW) * pixel_mm / HALF_HEIGHT_MM)


def breast_image(noise: float = 2.0, air: float = 40.0) -> NDArray[np.float32]:
    """A half-elliptical breast at column 0, brighter inside, with texture, noise and a bright label in the air."""
    radius = inside_share()
    row, column = np.indices(SHAPE)
    texture = 1.0 + 0.06 * np.sin(row / 13.0) * np.cos(column / 17.0)
    image = air + np.where(radius < 1.0, 900.0 * np.sqrt(np.clip(1.0 - radius**4, 0.05, None)) * texture, 0.0)
    image[20:40, 340:390] = 1500.0
    return (image + np.random.default_rng(1).normal(0.0, noise, SHAPE)).astype(np.float32)


def with_pectoral(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Brighten the upper posterior corner behind a straight edge from (column 0, row 400) to (column 130, row 120)."""
    row, column = np.indices(image.shape)
    behind = column / 130.0 + (row - 120.0) / 280.0 < 1.0 + 0.0 * column
    return np.where(behind & (inside_share() < 1.0), image + 450.0, image).astype(np.float32)


def with_glow(image: NDArray[np.float32], reach_mm: float = 25.0) -> NDArray[np.float32]:
    """As an 8-bit export with scatter beside the breast: air that fades from a fifth of the range to nearly nothing."""
    outside = np.clip(inside_share() - 1.0, 0.0, None) * DEPTH_MM
    glow = 45.0 * np.exp(-outside / reach_mm)
    grey = np.where(inside_share() < 1.0, 45.0 + (image - 40.0) * (200.0 / 900.0), glow)
    return np.rint(np.clip(grey, 0.0, 255.0)).astype(np.float32)


def fading_skin(air: float = 0.0) -> NDArray[np.float32]:
    """An 8-bit export whose breast darkens towards the skin until two grey values are left, over air that is even."""
    radius = inside_share()
    inside = 2.0 + 200.0 * np.clip(1.0 - radius, 0.0, None) ** 1.5
    return np.rint(air + np.where(radius < 1.0, inside, 0.0)).astype(np.float32)
