"""What stage `mesh` leaves: the undeformed breast as a block of hexahedra."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import ReferenceMesh
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Array, Fields, Value
from stages.engine.record import Record

# In a left breast LPS mirrors the block: swapping the ends of its first axis makes the elements right-handed again.
_MIRRORED_ORDER = [1, 0, 3, 2, 5, 4, 7, 6]


def lps_hexes(block: BlockMesh, side: Laterality) -> NDArray[np.int64]:
    """Connectivity (n^3, 8) whose Jacobians are positive in LPS, where a left breast is mirrored."""
    hexes = block.hexes()
    return hexes[:, _MIRRORED_ORDER] if side == "L" else hexes


def mesh_fields(block: BlockMesh, side: Laterality, values: Mapping[str, Value]) -> Fields:
    """The artefact's contents from a mesh in the breast frame and what else is to be known of it."""
    arrays = {
        "points": Array(breast_to_lps(block.points, side), "mm", "nodes of the block, first axis to medial"),
        "hexes": Array(lps_hexes(block, side), "1", "nodes of each hexahedron, VTK order"),
    }
    return Fields(arrays=arrays, values={"n": block.n, **values})


class MeshRecord(Record):
    """The undeformed mesh."""

    @property
    def elements(self) -> int:
        """Hexahedra a side."""
        return int(self.artefact.value("n"))

    @cached_property
    def block(self) -> BlockMesh:
        """The mesh in the breast frame."""
        return BlockMesh(self.elements, lps_to_breast(self.artefact.array("points", "mm"), self.laterality))

    @cached_property
    def reference(self) -> ReferenceMesh:
        """The mesh in the breast frame, ready to carry points."""
        return ReferenceMesh(self.block.points, self.block.hexes())
