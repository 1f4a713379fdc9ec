"""The grid of the MR volume as the user gave it, and masks on it."""

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Laterality
from stages.cohort.readers.mr.header import read_mr_grid


def mr_grid(path: Path, side: Laterality, series: str) -> tuple[tuple[int, ...], NDArray[np.float64]]:
    """Shape of the MR volume as the user gave it, and its affine (4, 4) from voxel index to LPS mm.

    Args:
        path: NIfTI file or folder of DICOM files.
        side: of the breast.
        series: the column `mr_series`.
    """
    grid = read_mr_grid(path, side, series)
    steps = [(grid.corners[far] - grid.corners[0]) / (n - 1) for far, n in zip((4, 2, 1), grid.shape, strict=True)]
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = np.array(steps).T, grid.corners[0]
    return grid.shape, affine


def on_grid(mask: Volume, shape: tuple[int, ...], affine: NDArray[np.float64]) -> NDArray[np.uint8]:
    """A mask at the voxels of another grid, by nearest neighbour.

    Args:
        mask: any grid, LPS.
        shape: of the other grid.
        affine: (4, 4) from its voxel indices to LPS mm.
    """
    found = np.zeros(shape, dtype=np.uint8)
    ends = mask.to_world(np.array(list(itertools.product(*((-1, n) for n in mask.shape)))))
    corners = (ends - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, shape)
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, shape)
    index = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1)
    places = index @ affine[:3, :3].T + affine[:3, 3]
    found[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = mask.sample(places, order=0) > 0.5
    return found
