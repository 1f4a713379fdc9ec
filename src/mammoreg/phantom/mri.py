"""MR volumes of a digital patient: signal, bias field, noise."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.phantom.anatomy import AIR, LUNG, MUSCLE, RIB, SKIN, SOFT, Tissue
from mammoreg.phantom.noise import SmoothNoise
from mammoreg.phantom.shape import Array

SUBSAMPLES = 2
"""Points per voxel side whose mean is the voxel's signal (partial volume)."""


@dataclass(frozen=True)
class Contrast:
    """Signal of each tissue, in the units of the stored image."""

    fat: float
    gland: float
    skin: float
    muscle: float
    rib: float
    lung: float
    lesion: float


T1 = Contrast(fat=900.0, gland=380.0, skin=430.0, muscle=330.0, rib=480.0, lung=70.0, lesion=300.0)
T1_FAT_SUPPRESSED = Contrast(fat=190.0, gland=430.0, skin=720.0, muscle=330.0, rib=200.0, lung=60.0, lesion=780.0)


@dataclass(frozen=True)
class Acquisition:
    """How a volume is taken.

    Attributes:
        contrast: signal of the tissues.
        noise: standard deviation of each channel of the complex signal.
        bias: relative size of the bias field.
    """

    contrast: Contrast
    noise: float
    bias: float


def tissue_signal(tissue: Tissue, contrast: Contrast) -> NDArray[np.float32]:
    """Signal (N,) of tissue."""
    by_kind = np.zeros(6, dtype=np.float32)
    by_kind[[AIR, SOFT, SKIN, MUSCLE, RIB, LUNG]] = [
        0.0, contrast.fat, contrast.skin, contrast.muscle, contrast.rib, contrast.lung,
    ]  # fmt: skip
    signal = by_kind[tissue.kind]
    signal += tissue.gland * np.float32(contrast.gland - contrast.fat)
    return np.asarray(signal + tissue.lesion * (np.float32(contrast.lesion) - signal))


def acquire(
    grid: Volume, tissue_at: Callable[[Array], Tissue], acquisition: Acquisition, random: Generator
) -> NDArray[np.int16]:
    """MR samples on a grid.

    Args:
        grid: where; its samples are not read.
        tissue_at: tissue at points (N, 3) of the grid's frame, mm.
        acquisition: contrast, noise and bias.
        random: source of bias and noise.
    """
    signal = np.stack([_plane(grid, k, tissue_at, acquisition.contrast) for k in range(grid.shape[0])])
    signal *= bias_field(grid, acquisition.bias, random)
    real = signal + acquisition.noise * random.standard_normal(signal.shape)
    imaginary = acquisition.noise * random.standard_normal(signal.shape)
    return np.round(np.hypot(real, imaginary)).astype(np.int16)


def _plane(grid: Volume, index: int, tissue_at: Callable[[Array], Tissue], contrast: Contrast) -> NDArray[np.float32]:
    """Mean signal of one plane of voxels across the first axis."""
    offsets = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    axes = [(np.arange(n)[:, None] + offsets).ravel() for n in (1, *grid.shape[1:])]
    axes[0] += index
    corner = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    signal = tissue_signal(tissue_at(grid.to_world(corner)), contrast)
    blocks = signal.reshape(SUBSAMPLES, grid.shape[1], SUBSAMPLES, grid.shape[2], SUBSAMPLES)
    return np.asarray(blocks.mean(axis=(0, 2, 4)))


def bias_field(grid: Volume, size: float, random: Generator) -> NDArray[np.float32]:
    """Factor of the coil: brighter in front, with a smooth random part; mean about 1."""
    coarse = [np.linspace(0.0, n - 1.0, min(n, 12)) for n in grid.shape]
    corner = np.stack(np.meshgrid(*coarse, indexing="ij"), axis=-1)
    shape = corner.shape[:-1]
    place = grid.to_world(corner.reshape(-1, 3)) / 45.0
    front = np.linspace(0.5, -0.5, shape[1])[None, :, None]
    values = size * (front + 0.5 * SmoothNoise.draw(random, 24, 2.0).at(place).reshape(shape))
    fine = Volume(np.exp(values), np.zeros(3), (np.array(grid.shape) - 1.0) / (np.array(shape) - 1.0))
    return _resampled(fine, grid.shape)


def _resampled(coarse: Volume, shape: tuple[int, int, int]) -> NDArray[np.float32]:
    """Linear interpolation of a coarse volume in voxel coordinates, axis by axis."""
    data = np.asarray(coarse.data, dtype=np.float64)
    for axis in range(3):
        place = np.arange(shape[axis]) / coarse.spacing[axis]
        low = np.minimum(place.astype(int), data.shape[axis] - 2)
        share = np.expand_dims(place - low, [a for a in range(3) if a != axis])
        data = data.take(low, axis) * (1.0 - share) + data.take(low + 1, axis) * share
    return data.astype(np.float32)
