"""What stage `mesh` leaves: the undeformed breast as a block of hexahedra."""

from collections.abc import Mapping
from functools import cached_property

from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import ReferenceMesh
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Array, Fields, Value
from stages.engine.record import Record


def mesh_fields(block: BlockMesh, side: Laterality, values: Mapping[str, Value]) -> Fields:
    """The artefact's contents from a mesh in the breast frame and what else is to be known of it."""
    arrays = {
        "points": Array(breast_to_lps(block.points, side), "mm", "nodes of the block, first axis to medial"),
        "hexes": Array(block.lps_hexes(side), "1", "nodes of each hexahedron, VTK order"),
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
