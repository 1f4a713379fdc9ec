"""What the digital patient consists of: tissues as functions of the undeformed position."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.phantom.lesion import Lesion
from mammoreg.phantom.noise import SmoothNoise, smooth_step
from mammoreg.phantom.shape import Array, BreastShape

AIR, SOFT, SKIN, MUSCLE, RIB, LUNG = 0, 1, 2, 3, 4, 5
DEPTH_SPACING_MM = 1.4
TISSUE_SPACING_MM = 0.7
SEPTUM_SHARE = 0.35

Shares = NDArray[np.float32]


@dataclass(frozen=True)
class Tissue:
    """Tissue at some points.

    Attributes:
        kind: AIR, SOFT (fat and gland), SKIN, MUSCLE, RIB or LUNG, uint8.
        gland: share of fibroglandular tissue where it is SOFT, 0 to 1.
        lesion: share of lesion, 0 to 1.
    """

    kind: NDArray[np.uint8]
    gland: Shares
    lesion: Shares


@dataclass(frozen=True)
class Layers:
    """Thickness in mm of skin, of the fat behind the torso's skin, of muscle and of the rib layer."""

    skin: float
    fat: float
    muscle: float
    ribs: float


@dataclass(frozen=True)
class Anatomy:
    """A whole patient in the breast frame.

    Attributes:
        shape: outer shape.
        layers: thickness of the layers.
        depth: signed depth below the skin, mm.
        gland: share of gland in the breast.
        lesion: the lesion, None for a healthy breast.
    """

    shape: BreastShape
    layers: Layers
    depth: Volume
    gland: Volume
    lesion: Lesion | None

    def at(self, points: Array) -> Tissue:
        """Tissue at undeformed points (N, 3), mm; nothing but the nipple is looked for in the air."""
        depth = self.depth.sample(points, outside=-1.0)
        kind, gland = np.full(len(points), AIR, dtype=np.uint8), np.zeros(len(points), dtype=np.float32)
        body = np.flatnonzero(depth >= 0.0)
        kind[body] = self._layer(points[body], depth[body])
        kind[self._in_nipple(points)] = SKIN
        soft = np.flatnonzero(kind == SOFT)
        gland[soft] = self.gland.sample(points[soft])
        return Tissue(kind, gland, self._lesion_share(points))

    def _layer(self, points: Array, depth: Array) -> NDArray[np.uint8]:
        """Kind of tissue at points (N, 3) in the body at a depth (N,) below the skin, mm."""
        behind = self.shape.torso.level(points[:, 0], points[:, 1], points[:, 2]) - self.layers.fat
        behind += self._undulation(points)
        inside = behind - self.layers.muscle
        kind = np.full(len(points), SOFT, dtype=np.uint8)
        kind[behind > 0.0] = MUSCLE
        kind[inside > 0.0] = np.where(self._between_ribs(points[inside > 0.0]), MUSCLE, RIB)
        kind[inside > self.layers.ribs] = LUNG
        kind[depth < self.layers.skin] = SKIN
        return kind

    def _in_nipple(self, points: Array) -> NDArray[np.intp]:
        """Numbers of the points in the nipple."""
        near = np.flatnonzero((np.abs(points - self.shape.tip) < 2.0 * self.shape.nipple_height).all(axis=1))
        return near[self.shape.nipple_level(*points[near].T) > 0.0]

    def _undulation(self, points: Array) -> Array:
        """Unevenness of the muscle's front, mm; it is nearer to the skin towards the arm."""
        m, s = points[:, 0], points[:, 2]
        waves = np.sin(s / 14.0 + m / 23.0) + 0.4 * np.sin(s / 6.1 - m / 9.0)
        return np.asarray(1.2 * waves + 0.03 * (s - self.shape.centre_s))

    def _between_ribs(self, points: Array) -> NDArray[np.bool_]:
        """Ribs run obliquely, one every 28 mm."""
        return np.asarray(np.cos((points[:, 2] - 0.35 * points[:, 0]) * (2.0 * np.pi / 28.0)) < 0.1)

    def _lesion_share(self, points: Array) -> Shares:
        share = np.zeros(len(points), dtype=np.float32)
        if self.lesion is not None:
            near = np.flatnonzero((np.abs(points - self.lesion.centre) < self.lesion.reach_mm).all(axis=1))
            share[near] = self.lesion.share(points[near])
        return share


def build_anatomy(
    shape: BreastShape,
    layers: Layers,
    gland_share: float,
    lesion: Lesion | None,
    box: tuple[Array, Array],
    random: Generator,
) -> Anatomy:
    """Fill a shape with tissue.

    Args:
        shape, layers: geometry.
        gland_share: share of the breast's tissue below the skin that is gland.
        lesion: the lesion.
        box: lowest and highest corner (3,) of what images will show, mm.
        random: source of the tissue's texture.
    """
    depth = _depth_volume(shape, box)
    return Anatomy(shape, layers, depth, _gland_volume(shape, depth, gland_share, random), lesion)


def _grid(lowest: Array, highest: Array, spacing: float) -> Volume:
    counts = np.ceil((highest - lowest) / spacing).astype(int) + 1
    return Volume(np.zeros(tuple(counts), dtype=np.float32), np.asarray(lowest, dtype=float), np.full(3, spacing))


def _axes(grid: Volume) -> tuple[Array, Array, Array]:
    """Broadcastable coordinates of a grid's voxel centres."""
    m, p, s = (grid.origin[k] + grid.spacing[k] * np.arange(grid.shape[k]) for k in range(3))
    return m[:, None, None], p[None, :, None], s[None, None, :]


def _depth_volume(shape: BreastShape, box: tuple[Array, Array]) -> Volume:
    """Level of breast, torso and nipple over the norm of its gradient: depth near the skin."""
    grid = _grid(box[0], box[1], DEPTH_SPACING_MM)
    level = shape.level(*_axes(grid))
    slope = np.sqrt(sum(np.square(np.gradient(level, DEPTH_SPACING_MM, axis=k)) for k in range(3)))
    depth = np.maximum(level / np.clip(slope, 0.4, 2.5), shape.nipple_level(*_axes(grid)))
    return grid.with_data(depth.astype(np.float32))


def _gland_volume(shape: BreastShape, depth: Volume, gland_share: float, random: Generator) -> Volume:
    """Share of gland on a fine grid over the breast."""
    reach = 1.25 * max(shape.lateral, shape.medial)
    lowest = np.array([shape.centre_m - reach, shape.tip[1] - 4.0, shape.centre_s - 1.3 * shape.inferior])
    highest = np.array([shape.centre_m + reach, shape.base_p + 30.0, shape.centre_s + 1.3 * shape.superior])
    grid = _grid(lowest, highest, TISSUE_SPACING_MM)
    ratio = shape.breast_ratio(*_axes(grid))
    index = np.flatnonzero((ratio < 1.05).ravel())
    points = grid.to_world(np.column_stack(np.unravel_index(index, grid.shape)))
    below = depth.sample(points)
    inner = below > 1.0
    score, septa = _gland_score(shape, points[inner], ratio.ravel()[index][inner], below[inner], random)
    share = np.zeros(grid.data.size, dtype=np.float32)
    in_front = points[inner, 1] < shape.back(points[inner, 0], points[inner, 2])
    threshold = float(np.quantile(score[in_front], 1.0 - gland_share))
    gland = np.maximum(smooth_step(score, threshold, 0.8), SEPTUM_SHARE * septa)
    share[index[inner]] = gland
    return grid.with_data(share.reshape(grid.shape))


def _gland_score(
    shape: BreastShape, points: Array, ratio: Array, depth: Array, random: Generator
) -> tuple[Shares, Shares]:
    """How readily gland grows at points (N, 3), and the share of thin septa in the fat."""
    lobes = SmoothNoise.draw(random).at(points / 8.0)
    islands = SmoothNoise.draw(random).at(points / 3.5)
    grain = SmoothNoise.draw(random).at(points / 1.4)
    ducts = SmoothNoise.draw(random).at(_duct_coordinates(shape, points))
    sheets = SmoothNoise.draw(random).at(points / np.array([5.0, 9.0, 5.0]))
    sideways = (shape.centre_m - points[:, 0]) / shape.lateral + (points[:, 2] - shape.centre_s) / shape.superior
    forward = (shape.base_p - points[:, 1]) / shape.length
    score = -((ratio / 0.75) ** 2) - 2.5 * np.exp(-depth / 3.5) - 2.0 * np.clip(0.2 - forward, 0.0, None) / 0.2
    near_nipple = np.exp(-((np.linalg.norm(points - shape.tip, axis=1) / 16.0) ** 2))
    score += 0.2 * sideways + 1.6 * near_nipple
    score = score + 0.35 * lobes + 0.65 * ducts + 0.55 * islands + 0.45 * grain
    septa = np.exp(-np.square(sheets / 0.15)) * smooth_step(depth.astype(np.float32), 3.0, 2.0)
    return score.astype(np.float32), septa.astype(np.float32)


def _duct_coordinates(shape: BreastShape, points: Array) -> Array:
    """Coordinates in which tissue that is stretched towards the nipple looks even."""
    behind = points - shape.tip + np.array([0.0, 18.0, 0.0])
    distance = np.maximum(behind[:, 1], 4.0)
    return np.column_stack([16.0 * behind[:, 0] / distance, 3.0 * np.log(distance), 16.0 * behind[:, 2] / distance])
