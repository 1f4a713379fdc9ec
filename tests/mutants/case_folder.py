"""A case in a folder of its own, with its two tables: what a mutation changes."""

import csv
import gzip
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pydicom
from PIL import Image

NAME = "case1"
PICTURE_COLUMNS = ("pixel_spacing_mm", "thickness_mm", "force_n", "angle_deg", "source_detector_mm", "orientation")


class DoesNotApplyError(Exception):
    """The case has nothing that this mutation could change."""


@dataclass
class Effect:
    """What a mutation did to the frames in which the answer stands.

    Attributes:
        pixels: by view, the affine map (2, 3) from the unmutated picture's (column, row) to the mutant's.
        world: the affine map (3, 4) of places of the MR volume, LPS mm, where volume and mask moved together.
        note: what was changed, in words.
    """

    pixels: dict[str, np.ndarray] = field(default_factory=dict)
    world: np.ndarray = field(default_factory=lambda: np.eye(3, 4))
    note: str = ""


@dataclass
class CaseFolder:
    """Rows and files of one case; `write_tables` makes the rows count.

    Attributes:
        case: its row of cases.tsv by column.
        views: its rows of views.tsv, by view as the unmutated table has it.
    """

    folder: Path
    case: dict[str, str]
    views: dict[str, dict[str, str]]

    @classmethod
    def copied(cls, base: Path, folder: Path) -> "CaseFolder":
        """A copy of a case's folder."""
        shutil.copytree(base, folder)
        return cls.read(folder)

    @classmethod
    def read(cls, folder: Path) -> "CaseFolder":
        (case,) = _rows(folder / "cases.tsv")
        return cls(folder, case, {row["view"]: row for row in _rows(folder / "views.tsv")})

    @property
    def tables(self) -> tuple[Path, Path]:
        return self.folder / "cases.tsv", self.folder / "views.tsv"

    def write_tables(self) -> None:
        for path, rows in zip(self.tables, ([self.case], list(self.views.values())), strict=True):
            columns = list(dict.fromkeys(column for row in rows for column in row))
            lines = [columns, *[[row.get(column, "") for column in columns] for row in rows]]
            path.write_text("".join("\t".join(line) + "\n" for line in lines), encoding="utf-8")

    def path(self, column: str, view: str | None = None, suffix: str = "") -> Path:
        """The file of a column; DoesNotApplyError where there is none or it has another ending."""
        cell = (self.case if view is None else self.views.get(view, {})).get(column, "")
        if not cell or not cell.endswith(suffix):
            raise DoesNotApplyError(f"no {column} {suffix}")
        return self.folder / cell

    def rename(self, column: str, view: str | None, name: str) -> Path:
        """Let a column name another file, which is yet to be written; the old one goes."""
        old, row = self.path(column, view), self.case if view is None else self.views[view]
        row[column] = name
        if old.is_file():
            old.unlink()
        new = self.folder / name
        new.parent.mkdir(parents=True, exist_ok=True)
        return new

    def slices(self) -> list[Path]:
        """Files of the MR volume's DICOM folder, in order."""
        folder = self.path("mr")
        if not folder.is_dir():
            raise DoesNotApplyError("the MR volume is no folder")
        return sorted(path for path in folder.iterdir() if path.is_file())


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return [{k: v for k, v in row.items() if v} for row in csv.DictReader(file, delimiter="\t")]


def nifti_of(case: CaseFolder, column: str = "mr") -> tuple[Path, Any, np.ndarray]:
    """A NIfTI file of the case: its path, the image and the voxels as stored."""
    path = case.path(column, suffix=".nii.gz")
    image = nibabel.load(path)
    return path, image, np.array(np.asanyarray(image.dataobj))


def save_nifti(path: Path, data: np.ndarray, affine: np.ndarray, image_type: Any = nibabel.Nifti1Image) -> None:
    """Both forms set, as scanners' converters write them."""
    image = image_type(data, affine)
    image.header.set_xyzt_units("mm", "sec")
    image.set_qform(affine, 1)
    image.set_sform(affine, 1)
    image.to_filename(path)


def world_map(old: np.ndarray, new: np.ndarray, voxels: np.ndarray | None = None) -> np.ndarray:
    """Map (3, 4) of places, LPS mm, from one NIfTI affine to another whose voxels are those of the first, moved."""
    to_lps, moved = np.diag([-1.0, -1.0, 1.0, 1.0]), np.eye(4) if voxels is None else voxels
    return (to_lps @ new @ moved @ np.linalg.inv(old) @ to_lps)[:3]


def raw_header(path: Path, change: Any) -> None:
    """Change the 352 bytes of a NIfTI header in place, past nibabel's own checks."""
    packed = path.suffix == ".gz"
    content = bytearray(gzip.decompress(path.read_bytes()) if packed else path.read_bytes())
    change(content)
    path.write_bytes(gzip.compress(bytes(content), 1, mtime=0) if packed else bytes(content))


def edit_dicom(path: Path, change: Any) -> None:
    """Change a DICOM file's dataset."""
    dataset = pydicom.dcmread(path)
    change(dataset)
    dataset.save_as(path)


def read_picture(path: Path) -> np.ndarray:
    """Grey values of a DICOM file or a picture."""
    if path.suffix == ".dcm":
        return np.array(pydicom.dcmread(path).pixel_array)
    with Image.open(path) as picture:
        return np.asarray(picture)


def write_picture(path: Path, pixels: np.ndarray) -> None:
    """Grey values into a DICOM file, its header kept, or a picture."""
    pixels = np.ascontiguousarray(pixels)
    if path.suffix != ".dcm":
        Image.fromarray(pixels).save(path)
        return

    def change(dataset: Any) -> None:
        dataset.Rows, dataset.Columns = pixels.shape
        dataset.PixelData = pixels.astype("<u2").tobytes()

    edit_dicom(path, change)


def read_table(path: Path) -> list[list[str]]:
    """Cells of a table of marks, its header first."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file, delimiter="\t"))


def write_table(path: Path, lines: list[list[str]]) -> None:
    path.write_text("".join("\t".join(line) + "\n" for line in lines), encoding="utf-8")
