"""Pixels as stored in a user's image and in its canonical form (chest wall at column 0, rows towards medial)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stages.artefact import Artefact


def canonical_pixels(pose: Artefact, stored: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (..., 2) as (column, row) of the canonical image from those of the stored one."""
    size, flip, scale = _storage(pose)
    pixels = np.asarray(stored, dtype=float)
    flipped = np.where(flip, size - 1 - pixels, pixels)
    return np.asarray((flipped + 0.5) * scale - 0.5)


def stored_pixels(pose: Artefact, canonical: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (..., 2) as (column, row) of the stored image from those of the canonical one."""
    size, flip, scale = _storage(pose)
    pixels = (np.asarray(canonical, dtype=float) + 0.5) / scale - 0.5
    return np.asarray(np.where(flip, size - 1 - pixels, pixels))


def canonical_image(pose: Artefact, stored: NDArray[Any]) -> NDArray[Any]:
    """A stored image or mask turned into the canonical one by flips."""
    _, flip, _ = _storage(pose)
    return np.ascontiguousarray(stored[:: -1 if flip[1] else 1, :: -1 if flip[0] else 1])


def _storage(pose: Artefact) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Stored size, flips and canonical pixels per stored one, each as (column, row)."""
    size = np.array([pose.value("stored_columns"), pose.value("stored_rows")], dtype=float)
    flip = np.array([pose.value("flip_columns"), pose.value("flip_rows")], dtype=bool)
    return size, flip, np.array([pose.value("columns"), pose.value("rows")], dtype=float) / size
