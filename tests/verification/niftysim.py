"""The pendant breast that NiftySim compressed (README of ../shared/data/fe), in the plate frame.

(medial, posterior, height) = (x, -z, y) of the source; which side is medial is unknown and does not matter here.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NearestNDInterpolator

from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.breast import build_mesh
from mammoreg.meshing.trilinear import shape_functions
from tests.shared_data import DATA
from tests.verification.hex_bodies import brick

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
LOWER_MM, UPPER_MM = 86.59, 151.66
MU_KPA = np.array([1.4876584389593062, 1.4876584389593062, 5.036691127418278, 6.6711140760507])
"""Shear moduli by label; 0, outside, counts as fat."""
WEIGHT = 1e-6 * 4905.0
"""Gravity times density, mN/mm3, towards larger heights."""


@dataclass(frozen=True)
class PendantBreast:
    """Nodes (N, 3), tetrahedra (E, 4), their tissue (E,), NiftySim's displacement (N, 3), nodes at the chest wall."""

    points: Floats
    tets: Indices
    tissue: Indices
    displacement: Floats
    chest: Indices

    @cached_property
    def labels(self) -> Volume:
        """Tissue at the points of a 1 mm grid, by the tetrahedron that each lies in; 0 outside."""
        low, high = self.points.min(axis=0) - 3.5, self.points.max(axis=0) + 3.5
        labels = np.zeros(tuple(np.ceil(high - low).astype(int)), dtype=np.uint8)
        corners = self.points[self.tets]
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).swapaxes(1, 2))
        first = np.ceil(corners.min(axis=1) - low).astype(int)
        size = np.floor(corners.max(axis=1) - low).astype(int) - first + 1
        for offset in np.ndindex(*size.max(axis=0)):
            near = (np.array(offset) < size).all(axis=1)
            index = first[near] + offset
            local = np.einsum("eij,ej->ei", inverse[near], low + index - corners[near, 0])
            inside = (local > -1e-9).all(axis=1) & (local.sum(axis=1) < 1.0 + 1e-9)
            labels[tuple(index[inside].T)] = self.tissue[near][inside]
        return Volume(labels, low, np.ones(3))

    def hexahedra(self, elements: int) -> BlockMesh:
        """The project's own mesh of the same body; the nipple is the point furthest from the chest."""
        labels = self.labels
        mask = labels.with_data((labels.data > 0).astype(np.uint8))
        nipple = self.points[self.points[:, 1].argmin()]
        return build_mesh(mask, self.points[self.chest], nipple, elements).mesh

    def shear_moduli(self, mesh: BlockMesh) -> Floats:
        """Mean shear modulus (E,), kPa, at 5 x 5 x 5 points of each hexahedron."""
        local, _ = brick((4, 4, 4), lambda unit: 1.8 * unit - 0.9)
        places = np.einsum("pa,eai->epi", shape_functions(local), mesh.points[mesh.hexes()])
        labels = self.labels
        index = np.clip(np.round(labels.to_index(places)).astype(int), 0, np.array(labels.data.shape) - 1)
        return np.asarray(MU_KPA[labels.data[tuple(np.moveaxis(index, -1, 0))]].mean(axis=1))

    def chest_turn(self, nodes: Floats) -> "ChestTurn":
        """The tie of nodes (B, 3) at the chest wall to the published shift and turn, by the nearest chest node."""
        nearest = NearestNDInterpolator(self.points[self.chest][:, [0, 2]], self.displacement[self.chest])
        return ChestTurn.of(nodes, nearest(nodes[:, [0, 2]]))


@dataclass(frozen=True)
class ChestTurn:
    """Mean shift to the side and mean turn about the nipple's axis of nodes at the chest wall.

    Attributes:
        measures: rows (2, 3 B) that give them, mm and rad, of displacements (B, 3).
        goal: their published values (2,).
    """

    measures: Floats
    goal: Floats

    @classmethod
    def of(cls, nodes: Floats, displacement: Floats) -> "ChestTurn":
        arm = nodes - nodes.mean(axis=0)
        measures = np.zeros((2, *nodes.shape))
        measures[0, :, 0] = 1.0 / len(nodes)
        measures[1, :, 2], measures[1, :, 0] = arm[:, 0], -arm[:, 2]
        measures[1] /= (arm[:, [0, 2]] ** 2).sum()
        rows = measures.reshape(2, -1)
        return cls(rows, rows @ displacement.ravel())


@dataclass(frozen=True)
class TurnTie:
    """A part of the equations (fem.parts) that holds back nodes at a `ChestTurn`, brought on with the load steps."""

    nodes: Indices
    rest: Floats
    turn: ChestTurn
    share: float = 1.0
    stiffness: tuple[float, float] = (1e4, 1e7)

    @property
    def dofs(self) -> Indices:
        return np.asarray((3 * self.nodes[:, None] + np.arange(3)).reshape(1, -1))

    def load(self, positions: Floats) -> Floats:
        """Force to the side, mN, and moment, mN mm, that hold the nodes."""
        moved = self.turn.measures @ (positions[self.nodes] - self.rest).ravel()
        return np.asarray(self.stiffness * (moved - self.share * self.turn.goal))

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        rows = self.turn.measures
        return (self.load(positions) @ rows)[None], (rows.T @ (np.array(self.stiffness)[:, None] * rows))[None]

    def energy_mj(self, positions: Floats) -> float:
        return 0.5e-3 * float((self.load(positions) ** 2 / self.stiffness).sum())

    def renewed(self, positions: Floats) -> "TurnTie":
        return self

    def at(self, share: float) -> "TurnTie":
        return replace(self, share=share)


def pendant_breast() -> PendantBreast:
    with h5py.File(DATA / "fe/breast_ct3_niftysim.h5") as file:
        return PendantBreast(
            points=file["points"][:] @ TURN.T,
            tets=file["tets"][:].astype(np.int64),
            tissue=file["tissue"][:].astype(np.int64),
            displacement=file["displacement"][:] @ TURN.T,
            chest=file["chest_wall_nodes"][:].astype(np.int64),
        )
