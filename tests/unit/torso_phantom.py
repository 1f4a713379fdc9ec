"""A torso with two breasts of known shape, for tests of the segmentation; breast frame or LPS, mm."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume

CHEST_P = 60.0
SKIN_MM = 1.8


@dataclass(frozen=True)
class Breast:
    """A breast as half an ellipsoid on the chest with a nipple.

    Attributes:
        centre: (x, z) of its base, mm.
        axes: half axes along x, depth and z, mm.
        nipple: (x, z) offset of the nipple from the centre, mm.
    """

    centre: tuple[float, float]
    axes: tuple[float, float, float]
    nipple: tuple[float, float] = (0.0, 0.0)

    def radius(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative radius of points (..., 3): 1 on the skin; behind the base the breast goes on as a cylinder."""
        a, d, c = self.axes
        ahead = np.minimum(points[..., 1] - CHEST_P, 0.0) / d
        return np.sqrt(
            ((points[..., 0] - self.centre[0]) / a) ** 2 + ahead**2 + ((points[..., 2] - self.centre[1]) / c) ** 2
        )

    def nipple_point(self) -> NDArray[np.float64]:
        """Where the nipple stands on the skin."""
        a, d, c = self.axes
        x, z = self.nipple
        p = CHEST_P - d * np.sqrt(1.0 - (x / a) ** 2 - (z / c) ** 2)
        return np.array([self.centre[0] + x, p, self.centre[1] + z])


RIGHT = Breast((-70.0, -5.0), (38.0, 75.0, 55.0), (-8.0, 10.0))
LEFT = Breast((75.0, 0.0), (34.0, 60.0, 48.0), (5.0, -8.0))


def torso(
    breasts: tuple[Breast, ...] = (RIGHT, LEFT),
    *,
    fat_suppressed: bool = True,
    noise: float = 6.0,
    spacing: float = 2.0,
    x_range: tuple[float, float] = (-140.0, 140.0),
) -> Volume:
    """MR intensities of the torso in LPS: chest with lung, muscle, skin, fat, gland, nipples, air with noise."""
    lower, upper = np.array([x_range[0], -45.0, -90.0]), np.array([x_range[1], 130.0, 85.0])
    counts = np.floor((upper - lower) / spacing).astype(int) + 1
    x, p, z = np.meshgrid(*[lo + spacing * np.arange(n) for lo, n in zip(lower, counts, strict=True)], indexing="ij")
    chest = p - CHEST_P - 0.002 * x**2
    depth, gland = chest, np.zeros_like(chest, dtype=bool)
    for breast in breasts:
        a, _, c = breast.axes
        radius = breast.radius(np.stack([x, p, z], axis=-1))
        depth = np.maximum(depth, (1.0 - radius) * min(a, c))
        tip = breast.nipple_point()
        bump = 6.0 - np.sqrt((x - tip[0]) ** 2 + (p - tip[1]) ** 2 + (z - tip[2]) ** 2)
        depth = np.maximum(depth, bump)
        gland |= (radius < 0.6) & (p < CHEST_P - 12.0) | (bump > 0.5)
    fat, glandular, skin = (150.0, 330.0, 520.0) if fat_suppressed else (700.0, 300.0, 330.0)
    signal = np.where(depth > 0.0, fat, 0.0)
    signal = np.where(gland & (depth > 0.0), glandular, signal)
    signal = np.where((depth > 0.0) & (depth < SKIN_MM), skin, signal)
    signal = np.where(chest > 14.0, glandular, signal)
    signal = np.where(chest > 30.0, 25.0, signal)
    random = np.random.default_rng(7)
    real = signal * (1.0 + 0.001 * z) + noise * random.standard_normal(signal.shape)
    magnitude = np.hypot(real, noise * random.standard_normal(signal.shape)).astype(np.float32)
    return Volume(magnitude, lower, np.full(3, spacing), "LPS")
