"""Any artefact in formats that other programs open: VTU meshes, NIfTI volumes, CSV tables."""

import csv
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact
from stages.engine.writing import write_bytes


def export_artefact(artefact: Artefact, folder: Path) -> list[Path]:
    """Write what an artefact holds as files named after its contents.

    Args:
        artefact: any.
        folder: where to; it is made.

    Returns:
        The files: `.vtu` for node positions of the block mesh, `.nii` for volumes, `.csv` for arrays of at most two
        dimensions and for values that are lists of rows.
    """
    contents = {**_volumes(artefact), **_arrays(artefact), **_tables(artefact)}
    paths = []
    for name, content in contents.items():
        path = folder / name.replace("/", ".")
        write_bytes(path, content)
        paths.append(path)
    return paths


def _volumes(artefact: Artefact) -> dict[str, bytes]:
    frames = {
        name.rpartition("/")[0]: texts["frame"] for name, _, texts in artefact.listing("volumes") if "frame" in texts
    }
    found = {}
    for name in artefact.volume_names():
        frame: Any = frames[name]
        found[f"{name}.nii"] = nifti_bytes(artefact.volume(name, frame=frame), lps=frame == "LPS")
    return found


def nifti_bytes(volume: Volume, *, lps: bool = True) -> bytes:
    """A volume as NIfTI, whose world is RAS; coordinates of another frame than LPS are kept as they are."""
    import nibabel

    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    if lps:
        affine = np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine
    data = np.asarray(volume.data)
    image: Any = nibabel.Nifti1Image(data.astype(np.float32) if data.dtype.kind == "f" else data, affine)
    image.header.set_xyzt_units("mm")
    return bytes(image.to_bytes())


def _arrays(artefact: Artefact) -> dict[str, bytes]:
    found = {}
    for name, shape, texts in artefact.listing("arrays"):
        data = artefact.array(name, texts["units"])
        n = round(shape[0] ** (1 / 3)) - 1 if shape else 0
        if len(shape) == 2 and shape[1] == 3 and n > 1 and shape[0] == (n + 1) ** 3:
            found[f"{name}.vtu"] = _vtu(artefact, n, data)
        elif len(shape) in (1, 2):
            header = [f"{name} ({texts['units']})", *[""] * (data.reshape(len(data), -1).shape[1] - 1)]
            found[f"{name}.csv"] = _csv([header, *data.reshape(len(data), -1).tolist()])
    return found


def _vtu(artefact: Artefact, n: int, points: NDArray[np.float64]) -> bytes:
    import meshio

    hexes = artefact.array("hexes", "1") if "hexes" in artefact.names() else BlockMesh(n, points).hexes()
    per_cell = {
        name: [artefact.array(name, texts["units"])]
        for name, shape, texts in artefact.listing("arrays")
        if shape == (len(hexes),)
    }
    mesh = meshio.Mesh(points, [("hexahedron", hexes)], cell_data=per_cell)
    # meshio writes VTU to named files only.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        mesh.write(path)
        return path.read_bytes()


def _tables(artefact: Artefact) -> dict[str, bytes]:
    rows = {name: artefact.value(name) for name in artefact.value_names()}
    return {
        f"{name}.csv": _csv(_lines(value))
        for name, value in rows.items()
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value)
    }


def _lines(rows: list[dict[str, Any]]) -> Iterator[list[Any]]:
    columns = list(dict.fromkeys(key for row in rows for key in row))
    yield columns
    for row in rows:
        yield ["" if row.get(column) is None else row.get(column) for column in columns]


def _csv(lines: Any) -> bytes:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(lines)
    return stream.getvalue().encode()
