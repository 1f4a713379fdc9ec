"""Outer shape of a digital patient: a pendant breast on a torso, as a level function in the breast frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def smooth_maximum(a: Array, b: Array, width: float) -> Array:
    """Maximum of two level functions in mm, rounded where they differ by less than `width` mm (polynomial blend)."""
    overlap = np.maximum(width - np.abs(a - b), 0.0) / width
    blended: Array = np.maximum(a, b) + 0.25 * width * overlap**2
    return blended


@dataclass(frozen=True)
class Torso:
    """Front of the chest: an elliptic cylinder around the superior axis, tilted.

    Attributes:
        front_p: posterior coordinate of the skin over the breast bone at superior 0, mm.
        half_width, half_depth: half axes along medial and posterior, mm.
        tilt: how far the front recedes per mm towards superior.
    """

    front_p: float
    half_width: float
    half_depth: float
    tilt: float

    def surface(self, m: ArrayLike, s: ArrayLike) -> Array:
        """Posterior coordinate in mm of the skin that the torso had without a breast."""
        level = 1.0 - (np.asarray(m, dtype=float) / self.half_width) ** 2
        depth = self.half_depth * (1.0 - np.sqrt(np.maximum(level, 0.01)))
        recess: Array = self.front_p + depth + self.tilt * np.asarray(s, dtype=float)
        return recess

    def level(self, m: Array, p: Array, s: Array) -> Array:
        """Signed depth below the torso's skin, roughly in mm; positive inside."""
        ratio = np.minimum(np.abs(m) / self.half_width, 0.99)
        slope = self.half_depth / self.half_width * ratio / np.sqrt(1.0 - ratio**2)
        return (p - self.surface(m, s)) / np.sqrt(1.0 + slope**2 + self.tilt**2)


@dataclass(frozen=True)
class BreastShape:
    """A prone, pendant breast: an asymmetric superellipsoid whose axis bends, blended into a torso.

    All lengths in mm; `t` runs along the axis from 0 at the torso to 1 at the tip.

    Attributes:
        torso: what the breast hangs from.
        centre_m, centre_s: middle of the breast's base.
        length: from the torso's skin to the tip, without the nipple.
        lateral, medial, inferior, superior: half axes at the base.
        drop_m, drop_s: how far the tip lies medial and superior of the base's middle (negative: lateral, inferior).
        slope: share of the superior half axis lost towards the tip (a sloping upper side).
        taper: share of all half axes lost towards the tip.
        roundness, bluntness: exponents of the cross-section and along the axis.
        blend: width of the smooth transition to the torso.
        nipple_radius, nipple_height: the nipple's size.
        back_lift: how far in front of the torso's skin the deforming tissue ends.
    """

    torso: Torso
    centre_m: float
    centre_s: float
    length: float
    lateral: float
    medial: float
    inferior: float
    superior: float
    drop_m: float
    drop_s: float
    slope: float
    taper: float
    roundness: float
    bluntness: float
    blend: float
    nipple_radius: float
    nipple_height: float
    back_lift: float

    @property
    def base_p(self) -> float:
        """Posterior coordinate of the torso's skin at the middle of the base, mm."""
        return float(self.torso.surface(self.centre_m, self.centre_s))

    def axis(self, t: ArrayLike) -> Array:
        """Points (..., 3) on the bent axis at t, mm."""
        t = np.asarray(t, dtype=float)
        bend = t**1.5
        return np.stack(
            [
                self.centre_m + self.drop_m * bend,
                self.base_p - self.length * t,
                self.centre_s + self.drop_s * bend,
            ],
            axis=-1,
        )

    def axis_direction(self, p: ArrayLike) -> Array:
        """Unit vectors (..., 3) along the bent axis at posterior coordinates p in mm, towards the nipple."""
        t = np.clip((self.base_p - np.asarray(p, dtype=float)) / self.length, 0.0, 1.0)
        bend = 1.5 * np.sqrt(t)
        along = np.stack([self.drop_m * bend, np.full_like(t, -self.length), self.drop_s * bend], axis=-1)
        return np.asarray(along / np.linalg.norm(along, axis=-1, keepdims=True))

    @property
    def tip(self) -> Array:
        """Foremost point of the breast's own surface, where the nipple stands: (3,), mm."""
        return self.axis(1.0)

    @property
    def nipple(self) -> Array:
        """Tip of the nipple (3,), mm."""
        return np.asarray(self.tip - np.array([0.0, self.nipple_height, 0.0]))

    def back(self, m: ArrayLike, s: ArrayLike) -> Array:
        """Posterior coordinate in mm of the surface where the deforming tissue is tied to the chest."""
        return self.torso.surface(m, s) - self.back_lift

    def breast_ratio(self, m: ArrayLike, p: ArrayLike, s: ArrayLike, scale: float = 1.0) -> Array:
        """Superellipsoid radius: 0 on the axis at the base, 1 on the surface of a breast scaled about its axis."""
        t = np.clip((self.base_p - np.asarray(p, dtype=float)) / self.length, 0.0, None)
        bend = np.minimum(t, 1.3) ** 1.5
        width = np.maximum(1.0 - self.taper * t, 0.2) * scale
        dm = np.asarray(m, dtype=float) - self.centre_m - self.drop_m * bend
        ds = np.asarray(s, dtype=float) - self.centre_s - self.drop_s * bend
        half_m = np.where(dm < 0.0, self.lateral, self.medial) * width
        upper = self.superior * np.maximum(1.0 - self.slope * t, 0.2)
        half_s = np.where(ds < 0.0, self.inferior, upper) * width
        e = self.roundness
        across = (np.abs(dm) / half_m) ** e + (np.abs(ds) / half_s) ** e
        ratio: Array = np.sqrt(across ** (2.0 / e) + (t / scale) ** self.bluntness)
        return ratio

    def level(self, m: ArrayLike, p: ArrayLike, s: ArrayLike) -> Array:
        """Signed depth below the skin of breast and torso without the nipple, roughly in mm; positive inside.

        The arrays broadcast against each other, so that a grid costs three vectors.
        """
        m, p, s = (np.asarray(c, dtype=float) for c in (m, p, s))
        radius = 0.25 * (self.lateral + self.medial + self.inferior + self.superior)
        breast = radius * (1.0 - self.breast_ratio(m, p, s))
        return smooth_maximum(breast, self.torso.level(m, p, s), self.blend)

    def nipple_level(self, m: ArrayLike, p: ArrayLike, s: ArrayLike) -> Array:
        """Signed depth inside the nipple, a rounded cylinder that stands on the tip; mm, positive inside."""
        tip = self.tip
        across = np.hypot(np.asarray(m, dtype=float) - tip[0], np.asarray(s, dtype=float) - tip[2])
        along = np.asarray(p, dtype=float) - (tip[1] - self.nipple_height)
        rounding = 0.6 * self.nipple_radius
        outside = np.hypot(np.maximum(across - (self.nipple_radius - rounding), 0.0), np.maximum(rounding - along, 0.0))
        depth: Array = rounding - outside
        return depth
