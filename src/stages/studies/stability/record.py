"""What `stability_scan_mesh` leaves: a scan's breast on meshes of several sizes."""

from collections.abc import Mapping

from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Array, Fields
from stages.engine.record import Record


def scan_mesh_fields(meshes: Mapping[int, BlockMesh], side: Laterality) -> Fields:
    """The artefact's contents from meshes in the breast frame by elements a side."""
    arrays = {
        f"points/{n}": Array(breast_to_lps(mesh.points, side), "mm", f"nodes of the block of {n} elements a side")
        for n, mesh in meshes.items()
    }
    return Fields(arrays=arrays, values={"laterality": side})


class ScanMeshRecord(Record):
    """Meshes of the scan's breast."""

    def block(self, elements: int) -> BlockMesh:
        """The mesh of so many elements a side, breast frame."""
        points = self.artefact.array(f"points/{elements}", "mm")
        return BlockMesh(elements, lps_to_breast(points, self.artefact.value("laterality")))
