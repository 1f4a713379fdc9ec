"""Volumes of any orientation as axis-aligned LPS volumes."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry.volume import Volume

ALIGNED_SINE = 0.002
"""Axes off the patient's by less than this (0.1 degree, 0.3 mm over a breast) count as aligned."""


def volume_of_affine(data: NDArray[Any], affine: NDArray[np.float64], order: Literal[0, 1] = 1) -> Volume:
    """Reorder voxels so that the axes run along +x, +y, +z of LPS; resample where no reordering does.

    Args:
        data: voxels (ni, nj, nk).
        affine: (4, 4) from voxel indices to LPS, mm; that of a NIfTI file leads to RAS and needs its first two rows
            negated.
        order: interpolation of oblique volumes, 0 nearest, 1 linear.
    """
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    cosines = affine[:3, :3] / spacing
    axes = _nearest_axes(cosines)
    signs = np.sign(cosines[axes, np.arange(3)])
    if np.abs(cosines - np.eye(3)[:, axes] * signs).max() > ALIGNED_SINE:
        return _resampled(data, affine, spacing[np.argsort(axes)], order)
    flipped = data[tuple(slice(None, None, int(sign)) for sign in signs)]
    start = affine[:3, 3] + affine[:3, :3] @ np.where(signs < 0, np.array(data.shape) - 1, 0)
    back = np.argsort(axes)
    return Volume(np.ascontiguousarray(flipped.transpose(back)), start, spacing[back], "LPS")


def _nearest_axes(cosines: NDArray[np.float64]) -> NDArray[np.intp]:
    """The patient axis nearest to each voxel axis; each is taken once, the best match first."""
    left, axes = np.abs(cosines), np.zeros(3, dtype=np.intp)
    for _ in range(3):
        patient, voxel = np.unravel_index(int(np.argmax(left)), left.shape)
        axes[voxel] = patient
        left[patient, :] = left[:, voxel] = -1.0
    return axes


def _resampled(
    data: NDArray[Any], affine: NDArray[np.float64], spacing: NDArray[np.float64], order: Literal[0, 1]
) -> Volume:
    """An oblique volume on the smallest axis-aligned grid that holds it; 0 outside it."""
    ends = np.array(np.meshgrid(*[(0, n - 1) for n in data.shape])).reshape(3, -1)
    corners = affine[:3, :3] @ ends + affine[:3, 3:]
    origin = corners.min(axis=1)
    shape = tuple(int(n) + 1 for n in np.ceil((corners.max(axis=1) - origin) / spacing))
    inverse = np.linalg.inv(affine[:3, :3])
    offset = inverse @ (origin - affine[:3, 3])
    from scipy import ndimage  # when it is needed: it takes half a second to import

    found = ndimage.affine_transform(data, inverse * spacing, offset=offset.tolist(), output_shape=shape, order=order)
    return Volume(np.asarray(found), origin, spacing, "LPS")
