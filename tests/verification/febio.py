"""FEBio's half-ellipsoid breast between plates (design note on the solver), in the plate frame."""

from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.parts.back import BackCondition, held_back
from tests.shared_data import DATA

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
HEIGHT_MM = 110.0
FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


@dataclass(frozen=True)
class HalfEllipsoid:
    """Mesh, node sets as faces and back condition, and FEBio's displacements by compression.

    Attributes:
        points, hexes: mesh, plate frame.
        skin, back: faces (F, 4).
        held: chest nodes slide in their plane, the middle ones are fixed.
        displacement: FEBio's (N, 3), mm, by compression in percent.
    """

    points: Floats
    hexes: Indices
    skin: Indices
    back: Indices
    held: BackCondition
    displacement: dict[int, Floats]


def half_ellipsoid(elements: int) -> HalfEllipsoid:
    """The body with 7 or 14 elements a side."""
    with h5py.File(DATA / "fe/febio_plates.h5") as file:
        group = file[f"n{elements}"]
        points, hexes = _plate_frame(group["points"][:]), group["hexes"][:].astype(np.int64)
        chest, core = group["nset_chest"][:], group["nset_core"][:]
        displacement = {c: _plate_frame(group[f"displacement_0.{c}"][:]) for c in (21, 50)}
    faces = boundary_faces(hexes)
    behind = np.isin(faces, chest).all(axis=1)
    held = np.zeros((len(chest), 3), dtype=bool)
    held[:, 1] = True
    held[np.isin(chest, core)] = True
    return HalfEllipsoid(points, hexes, faces[~behind], faces[behind], held_back(chest, held), displacement)


def boundary_faces(hexes: Indices) -> Indices:
    """Faces (F, 4) that belong to one element only."""
    faces = hexes[:, FACES].reshape(-1, 4)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[np.sort(first[count == 1])])


def _plate_frame(vectors: Floats) -> Floats:
    """From (depth, lateral, height) to (medial, posterior, height)."""
    return np.stack([vectors[:, 1], -vectors[:, 0], vectors[:, 2]], axis=1)
