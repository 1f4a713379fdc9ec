"""VTU meshes, which ParaView and 3D Slicer open; in LPS mm, as the file itself says."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from mammoreg.arrays import Points

FRAME_FIELD = "LPS_mm"
"""Field data of every mesh: its name says the coordinates' frame and unit (readers differ in taking texts)."""
_GRID = b"<UnstructuredGrid>"
_SAID = (
    b"<!-- coordinates: DICOM patient coordinates LPS (x left, y posterior, z superior), mm -->"
    b'<FieldData><DataArray type="Int64" Name="%s" NumberOfTuples="1" format="ascii">1</DataArray></FieldData>'
    % FRAME_FIELD.encode()
)


def vtu_bytes(
    points_lps: Points, hexes: NDArray[Any], point_data: Mapping[str, Any], cell_data: Mapping[str, Any]
) -> bytes:
    """A hexahedral mesh.

    Args:
        points_lps: nodes (N, 3), LPS mm.
        hexes: node numbers (E, 8), VTK order.
        point_data: one value or vector a node, by name.
        cell_data: a list of one array a block of cells, by name.
    """
    import meshio

    mesh = meshio.Mesh(points_lps, [("hexahedron", hexes)], point_data=dict(point_data), cell_data=dict(cell_data))
    # meshio writes VTU to named files only.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        mesh.write(path)
        return path.read_bytes().replace(_GRID, _GRID + _SAID, 1)
