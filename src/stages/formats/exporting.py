"""Any artefact in formats that other programs open: VTU, NIfTI, PNG, TIFF and CSV, in patient coordinates."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry.frames import plate_to_lps, plate_to_lps_affine
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact
from stages.engine.errors import UserError
from stages.engine.writing import write_bytes
from stages.formats.images import grey_tiff, mask_png
from stages.formats.nifti import nifti_bytes, volume_affine
from stages.formats.pages import as_csv
from stages.formats.vtu import vtu_bytes
from stages.views import SECOND_VOLUME

_SMALLEST_IMAGE = 8
_HEAD = (
    "Research use only. {what}. Coordinates are the patient's: DICOM's LPS in mm, which NIfTI files say in their RAS."
)
_AS_POSED = (
    "The breast lies where the pose has its plates; on a second MR volume it lies in the case's folder `export` alone."
)


@dataclass
class Export:
    """What became of an artefact.

    Attributes:
        files: contents by file name.
        about: what each file holds.
        left_out: what was not written, and why.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    about: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def add(self, file_name: str, content: bytes, about: str) -> None:
        """Keep a file."""
        self.files[file_name.replace("/", ".")] = content
        self.about[file_name.replace("/", ".")] = about

    def readme(self, what: str, as_posed: bool) -> bytes:
        """The account of the files in words."""
        lines = [_HEAD.format(what=what), *([_AS_POSED] if as_posed else []), ""]
        lines += [f"{name}: {about}" for name, about in self.about.items()]
        lines += [f"not written: {name}: {reason}" for name, reason in self.left_out.items()]
        return ("\n".join(lines) + "\n").encode()


def export_artefact(artefact: Artefact, folder: Path) -> tuple[list[Path], list[str]]:
    """Write what an artefact holds as files named after its contents, and a README.txt that says what they are.

    Args:
        artefact: any.
        folder: where to; it is made.

    Returns:
        The files: `.vtu` for node positions of the block mesh, `.nii.gz` for volumes, `.png` and `.tiff` for images,
        `.csv` for other arrays of at most two dimensions and for values that are lists of rows. And what was left
        out, with the reason.

    Raises:
        UserError: the artefact holds nothing for other programs, or nothing that can be placed in the patient.
    """
    export = Export()
    _add_volumes(artefact, export)
    _add_arrays(artefact, export)
    for name in artefact.value_names():
        _add_table(name, artefact.value(name), export)
    left_out = [f"{name}: {reason}" for name, reason in export.left_out.items()]
    if not export.files:
        reasons = f": {'; '.join(left_out)}" if left_out else "; see its contents with `show`"
        raise UserError(f"{artefact.path.name} holds nothing that can be exported{reasons}")
    what = f"{artefact.stage} of {artefact.case}{f' {artefact.view}' if artefact.view else ''}"
    export.files["README.txt"] = export.readme(what, _has_plate_frame(artefact))
    for name, content in export.files.items():
        write_bytes(folder / name, content)
    return [folder / name for name in export.files], left_out


def _has_plate_frame(artefact: Artefact) -> bool:
    return any(
        texts.get("frame") == "plate" for kind in ("volumes", "arrays") for _, _, texts in _listing(artefact, kind)
    )


def _listing(artefact: Artefact, kind: Any) -> list[tuple[str, tuple[int, ...], dict[str, str]]]:
    return artefact.listing(kind)


def _unplaced(artefact: Artefact) -> str:
    """Why what is in the plate frame cannot be placed in the patient; empty where it can."""
    if artefact.view == SECOND_VOLUME:
        return "`localize` alone places it, on the second MR volume if any: take it from the case's folder `export`"
    return "" if artefact.has("angle_deg") else "its artefact does not hold the angle of its plates"


def _add_volumes(artefact: Artefact, export: Export) -> None:
    described = {name.rpartition("/")[0]: texts for name, _, texts in artefact.listing("volumes")}
    described |= {n.rpartition("/")[0]: t for n, _, t in artefact.listing("volumes") if "frame" in t}
    for name in artefact.volume_names():
        texts: Any = described[name]
        turn = np.eye(4)
        if texts["frame"] == "plate":
            if reason := _unplaced(artefact):
                export.left_out[name] = reason
                continue
            turn = plate_to_lps_affine(float(artefact.value("angle_deg")), artefact.laterality)
        volume = artefact.volume(name, frame=texts["frame"])
        data = np.asarray(volume.data)
        data = data.astype(np.float32) if data.dtype.kind == "f" else data
        about = f"{texts['long_name']} ({texts['units']})"
        export.add(f"{name}.nii.gz", nifti_bytes(data, turn @ volume_affine(volume)), about)


def _add_arrays(artefact: Artefact, export: Export) -> None:
    for name, shape, texts in artefact.listing("arrays"):
        data, about = artefact.array(name, texts["units"]), f"{texts['long_name']} ({texts['units']})"
        if texts.get("frame") == "plate":
            if reason := _unplaced(artefact):
                export.left_out[name] = reason
                continue
            data = plate_to_lps(data, float(artefact.value("angle_deg")), artefact.laterality)
            about = about.replace("plate frame", "LPS")
        side = _nodes_a_side(shape)
        if side is not None:
            export.add(f"{name}.vtu", _vtu(artefact, side - 1, data), about)
        elif len(shape) == 2 and min(shape) >= _SMALLEST_IMAGE:
            _add_image(name, data, about, export)
        elif len(shape) in (1, 2):
            export.add(f"{name}.csv", _csv(name, texts["units"], data), about)
        else:
            export.left_out[name] = f"an array of {len(shape)} dimensions; only the pipeline reads it"


def _nodes_a_side(shape: tuple[int, ...]) -> int | None:
    """Nodes a side of the block mesh whose positions have this shape."""
    side = round(shape[0] ** (1 / 3)) if len(shape) == 2 and shape[1] == 3 else 0
    return side if side > 2 and side**3 == shape[0] else None


def _add_image(name: str, data: NDArray[Any], about: str, export: Export) -> None:
    is_mask = data.dtype.kind in "biu" and data.max(initial=0) <= 1
    ending, content = ("png", mask_png(data)) if is_mask else ("tiff", grey_tiff(data))
    export.add(f"{name}.{ending}", content, f"{about}; a picture of pixels, as the pipeline turns it: chest wall left")


def _vtu(artefact: Artefact, n: int, points: Points) -> bytes:
    names = artefact.names()
    hexes = artefact.array("hexes", "1") if "hexes" in names else BlockMesh(n, points).lps_hexes(artefact.laterality)
    per_cell = {
        name: [artefact.array(name, texts["units"])]
        for name, shape, texts in artefact.listing("arrays")
        if shape == (len(hexes),)
    }
    return vtu_bytes(points, hexes, {}, per_cell)


def _add_table(name: str, value: Any, export: Export) -> None:
    if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
        columns = list(dict.fromkeys(key for row in value for key in row))
        export.add(f"{name}.csv", as_csv(columns, _cells(value, columns)), "a table")


def _cells(rows: list[dict[str, Any]], columns: list[str]) -> Iterator[list[str]]:
    for row in rows:
        yield ["" if row.get(column) is None else str(row[column]) for column in columns]


def _csv(name: str, units: str, data: NDArray[Any]) -> bytes:
    lines = data.reshape(len(data), -1)
    width = lines.shape[1]
    header = [f"{axis} ({name}, {units})" for axis in "xyz"] if (units, width) == ("mm", 3) else [f"{name} ({units})"]
    return as_csv([*header, *[""] * (width - len(header))], [[str(x) for x in line] for line in lines.tolist()])
