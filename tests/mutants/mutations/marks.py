"""Marks: other frames, units, separators and grids; masks that mark something else."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.random import Generator
from PIL import Image
from scipy import ndimage

from tests.mutants.case_folder import CaseFolder, Effect, nifti_of, read_table, save_nifti, write_table
from tests.mutants.mutations.registry import Mutations

MARKS = Mutations("marks", ("pictures",))
Cells = list[list[str]]


def numbers(
    case: CaseFolder,
    random: Generator,
    column: str,
    change: Callable[[np.ndarray], np.ndarray],
    view: str | None = None,
) -> Effect:
    """Change the coordinates of every row of a table."""
    path = case.path(column, view, ".tsv")
    header, *lines = read_table(path)
    places = [header.index(name) for name in (("column", "row") if "column" in header else ("x", "y", "z"))]
    for line in lines:
        for place, value in zip(places, change(np.array([float(line[p]) for p in places])), strict=True):
            line[place] = f"{value:.4f}"
    write_table(path, [header, *lines])
    return Effect(note=f"{column} {view or ''}".strip())


def in_voxels(case: CaseFolder, random: Generator, column: str) -> Effect:
    """Voxel indices in place of coordinates."""
    _, image, _ = nifti_of(case)
    back = np.linalg.inv(image.affine)
    return numbers(case, random, column, lambda p: (back @ [*(p * [-1, -1, 1]), 1.0])[:3])


def diameter(case: CaseFolder, random: Generator, column: str, factor: float, view: str | None = None) -> Effect:
    path = case.path(column, view, ".tsv")
    header, *lines = read_table(path)
    for line in lines:
        line[-1] = f"{float(line[-1]) * factor:g}"
    write_table(path, [header, *lines])
    return Effect(note=f"{column} {view or ''}, diameter times {factor:g}")


def text(
    case: CaseFolder,
    random: Generator,
    column: str,
    change: Callable[[str], str],
    view: str | None = None,
    encoding: str = "utf-8",
) -> Effect:
    """Change a table as text."""
    path = case.path(column, view, ".tsv")
    path.write_bytes(change(path.read_text(encoding="utf-8")).encode(encoding))
    return Effect(note=f"{column} {view or ''}".strip())


def cells(
    case: CaseFolder, random: Generator, column: str, change: Callable[[Cells], Cells], view: str | None = None
) -> Effect:
    path = case.path(column, view, ".tsv")
    write_table(path, change(read_table(path)))
    return Effect(note=f"{column} {view or ''}".strip())


def mr_mask(case: CaseFolder, random: Generator, change: Callable[[np.ndarray, Generator], np.ndarray]) -> Effect:
    path, image, data = nifti_of(case, "mr_lesion")
    save_nifti(path, change(data, random), image.affine)
    return Effect(note="mr_lesion")


def mr_mask_moved(case: CaseFolder, random: Generator, far: float) -> Effect:
    """The mask's grid at another place than the volume's."""
    path, image, data = nifti_of(case, "mr_lesion")
    affine = np.array(image.affine)
    affine[:3, 3] += far * random.choice([-1.0, 1.0], 3)
    save_nifti(path, data, affine)
    return Effect(note=f"mr_lesion moved by {far:g} mm along each axis")


def mr_mask_coarse(case: CaseFolder, random: Generator) -> Effect:
    """The mask on a grid of its own, of every second voxel."""
    path, image, data = nifti_of(case, "mr_lesion")
    save_nifti(path, data[::2, ::2, ::2], image.affine @ np.diag([2.0, 2.0, 2.0, 1.0]))
    return Effect(note="mr_lesion on a foreign grid")


def mr_mask_ras(case: CaseFolder, random: Generator) -> Effect:
    """The mask's affine in LPS where NIfTI means RAS."""
    path, image, data = nifti_of(case, "mr_lesion")
    save_nifti(path, data, np.diag([-1.0, -1.0, 1.0, 1.0]) @ image.affine)
    return Effect(note="mr_lesion with LPS signs")


def view_mask(
    case: CaseFolder, random: Generator, change: Callable[[np.ndarray, Generator], np.ndarray], view: str = "CC"
) -> Effect:
    path = case.path("lesion", view, ".png")
    with Image.open(path) as picture:
        mask = np.asarray(picture)
    Image.fromarray(np.ascontiguousarray(change(mask, random))).save(path)
    return Effect(note=f"lesion {view}")


def soft(mask: np.ndarray, random: Generator) -> np.ndarray:
    """A probability map without a zero."""
    smooth = ndimage.gaussian_filter((mask > 0).astype(float), 1.5)
    return (4e-11 + smooth).astype(np.float32)


def inverted(mask: np.ndarray, random: Generator) -> np.ndarray:
    return (mask == 0).astype(np.uint8) * 255


def nothing(mask: np.ndarray, random: Generator) -> np.ndarray:
    return np.zeros_like(mask)


def everything(mask: np.ndarray, random: Generator) -> np.ndarray:
    return np.full_like(mask, 255)


def two_parts(mask: np.ndarray, random: Generator) -> np.ndarray:
    return np.asarray(mask | np.roll(mask, mask.shape[0] // 4, axis=0))


def reversed_first(mask: np.ndarray, random: Generator) -> np.ndarray:
    return mask[::-1]


def transposed(mask: np.ndarray, random: Generator) -> np.ndarray:
    return mask.T


def in_a_corner(mask: np.ndarray, random: Generator) -> np.ndarray:
    """A mark in the air."""
    found = np.zeros_like(mask)
    found[tuple(slice(3, 8) for _ in mask.shape)] = mask.max()
    return found


def not_finite(mask: np.ndarray, random: Generator) -> np.ndarray:
    return np.where(mask > 0, np.nan, 0.0).astype(np.float32)


def half_size(mask: np.ndarray, random: Generator) -> np.ndarray:
    return mask[::2, ::2]


def filled(mask: np.ndarray, random: Generator) -> np.ndarray:
    """A mask that fills the breast and more."""
    return ndimage.binary_dilation(mask > 0, iterations=25).astype(np.uint8)


def _line(text_: str, number: int, change: Callable[[list[str]], list[str]]) -> str:
    lines = text_.splitlines()
    lines[number] = "\t".join(change(lines[number].split("\t")))
    return "\n".join(lines) + "\n"


def swapped(*order: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda p: p[list(order)]


def factor(*by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda p: p * by


MR_TABLES: Sequence[tuple[str, bool]] = (("mr_lesion", False), ("mr_landmarks", True))
for _column, _landmarks in MR_TABLES:
    _bases = ("pictures",) if _column == "mr_lesion" else ("pictures", "both")
    for _name, _change in {
        "in RAS": factor(-1, -1, 1),
        "x reversed": factor(-1, 1, 1),
        "y reversed": factor(1, -1, 1),
        "z reversed": factor(1, 1, -1),
        "in cm": factor(0.1, 0.1, 0.1),
        "in m": factor(0.001, 0.001, 0.001),
        "in micrometres": factor(1000, 1000, 1000),
        "x and y swapped": swapped(1, 0, 2),
        "y and z swapped": swapped(0, 2, 1),
        "shifted by the volume": lambda p: p + np.array([150.0, 0.0, 0.0]),
    }.items():
        MARKS.add(
            f"{_column}: {_name}", partial(numbers, column=_column, change=_change), bases=_bases, landmarks=_landmarks
        )
    MARKS.add(f"{_column}: voxels for mm", partial(in_voxels, column=_column), bases=_bases, landmarks=_landmarks)
PIXEL_CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "column and row swapped": swapped(1, 0),
    "in mm": factor(0.4, 0.4),
    "in cm": factor(0.04, 0.04),
    "from the other corner": lambda p: [449.0, 649.0] - p,
    "from the other side": lambda p: [449.0 - p[0], p[1]],
    "of a larger export": factor(2, 2),
}
for _view in ("CC", "MLO"):
    for _name, _change in PIXEL_CHANGES.items():
        MARKS.add(f"lesion {_view}: {_name}", partial(numbers, column="lesion", change=_change, view=_view))
for _factor in (10.0, 0.1):
    MARKS.add(f"mr_lesion: diameter times {_factor:g}", partial(diameter, column="mr_lesion", factor=_factor))
    MARKS.add(f"lesion CC: diameter times {_factor:g}", partial(diameter, column="lesion", factor=_factor, view="CC"))
for _column, _view in (("mr_lesion", None), ("lesion", "CC"), ("mr_landmarks", None)):
    _label, _is = f"{_column} {_view or ''}".strip(), _column == "mr_landmarks"
    for _name, _text in {
        "decimal commas": lambda t: t.replace(".", ","),
        "commas between columns": lambda t: t.replace("\t", ","),
        "semicolons between columns": lambda t: t.replace("\t", ";"),
        "no header": lambda t: t.partition("\n")[2],
        "header alone": lambda t: t.partition("\n")[0] + "\n",
        "a cell empty": lambda t: _line(t, 1, lambda cells: [cells[0], "", *cells[2:]]),
        "a cell no number": lambda t: _line(t, 1, lambda cells: [cells[0], "n/a", *cells[2:]]),
        "a cell infinite": lambda t: _line(t, 1, lambda cells: [cells[0], "inf", *cells[2:]]),
        "a name twice": lambda t: t + t.splitlines()[1] + "\n",
        "a cell too many": lambda t: _line(t, 1, lambda cells: [*cells, "7"]),
        "a cell too few": lambda t: _line(t, 1, lambda cells: cells[:-1]),
        "columns misnamed": lambda t: t.replace("name", "label", 1),
    }.items():
        MARKS.add(f"{_label}: {_name}", partial(text, column=_column, change=_text, view=_view), landmarks=_is)
    MARKS.add(
        f"{_label}: UTF-16", partial(text, column=_column, change=str, view=_view, encoding="utf-16"), landmarks=_is
    )
for _change in (soft, inverted, nothing, everything, two_parts, reversed_first, in_a_corner, not_finite, filled):
    MARKS.add(f"MR mask: {_change.__name__.replace('_', ' ')}", partial(mr_mask, change=_change), bases=("nifti",))
MARKS.add("MR mask: axes swapped", partial(mr_mask, change=transposed), bases=("nifti",))
for _far in (0.7, 5.0, 40.0):
    MARKS.add(f"MR mask: grid moved by {_far:g} mm", partial(mr_mask_moved, far=_far), bases=("nifti",))
MARKS.add("MR mask: foreign grid", mr_mask_coarse, bases=("nifti",))
MARKS.add("MR mask: LPS signs", mr_mask_ras, bases=("nifti", "both"))
for _view in ("CC", "MLO"):
    for _change in (inverted, nothing, everything, two_parts, reversed_first, transposed, in_a_corner, half_size):
        MARKS.add(
            f"mask of {_view}: {_change.__name__.replace('_', ' ')}",
            partial(view_mask, change=_change, view=_view),
            bases=("nifti",),
        )
MUTATIONS = MARKS.found
