"""Pixels of mammograms: turned, cut, scaled, framed, spoiled; marks go with the picture where a program would do so."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from tests.mutants.case_folder import (
    CaseFolder,
    DoesNotApplyError,
    Effect,
    edit_dicom,
    read_picture,
    read_table,
    write_picture,
    write_table,
)
from tests.mutants.mutations.registry import Mutations

Pixels = NDArray[np.generic]
PICTURES = Mutations("mammogram picture", ("pictures", "nifti"))


def drawn(case: CaseFolder, random: Generator) -> str:
    views = sorted(case.views)
    return views[int(random.integers(len(views)))]


def moved(case: CaseFolder, view: str, change: Callable[[Pixels], Pixels], to: np.ndarray) -> None:
    """Change a picture and carry its marks along by the affine map (2, 3) of (column, row)."""
    path = case.path("image", view)
    write_picture(path, change(read_picture(path)))
    for column in ("lesion", "landmarks"):
        try:
            marks = case.path(column, view)
        except DoesNotApplyError:
            continue
        if marks.suffix == ".tsv":
            _move_table(marks, to)
        else:
            with Image.open(marks) as picture:
                mask = np.asarray(picture)
            Image.fromarray(np.ascontiguousarray(change(mask))).save(marks)


def _move_table(path, to: np.ndarray) -> None:
    header, *lines = read_table(path)
    places = [header.index("column"), header.index("row")]
    for line in lines:
        new = to @ [*(float(line[p]) for p in places), 1.0]
        for place, value in zip(places, new, strict=True):
            line[place] = f"{value:.2f}"
    write_table(path, [header, *lines])


def turning(shape: tuple[int, ...], name: str) -> tuple[Callable[[Pixels], Pixels], np.ndarray]:
    """A turn or a mirror of a picture and its map of (column, row)."""
    rows, columns = shape[0] - 1.0, shape[1] - 1.0
    known: dict[str, tuple[Callable[[Pixels], Pixels], list[list[float]]]] = {
        "half a turn": (lambda p: np.rot90(p, 2), [[-1, 0, columns], [0, -1, rows]]),
        "quarter turn": (lambda p: np.rot90(p, 1), [[0, 1, 0], [-1, 0, columns]]),
        "mirrored": (lambda p: p[:, ::-1], [[-1, 0, columns], [0, 1, 0]]),
        "upside down": (lambda p: p[::-1], [[1, 0, 0], [0, -1, rows]]),
    }
    change, to = known[name]
    return change, np.array(to, dtype=float)


def turned(case: CaseFolder, random: Generator, name: str, told: bool = False, asked: bool = False) -> Effect:
    """Turn a picture with its marks.

    Args:
        told: the orientation is changed with it, so that nothing is wrong.
        asked: no orientation is given, so that the picture alone can tell.
    """
    view = drawn(case, random)
    path = case.path("image", view)
    if asked and path.suffix != ".png":
        raise DoesNotApplyError("orientation")
    change, to = turning(read_picture(path).shape, name)
    moved(case, view, change, to)
    if told:
        _tell_orientation(case, view, name)
    if asked:
        case.views[view].pop("orientation", None)
    return Effect({view: to}, note=f"{view} {name}")


def _tell_orientation(case: CaseFolder, view: str, name: str) -> None:
    opposite = str.maketrans("APRLHF", "PALRFH")

    def new(first: str, second: str) -> list[str]:
        columns, rows = name in ("half a turn", "mirrored"), name in ("half a turn", "upside down")
        return [first.translate(opposite) if columns else first, second.translate(opposite) if rows else second]

    path = case.path("image", view)
    if path.suffix == ".png":
        case.views[view]["orientation"] = "\\".join(new(*case.views[view]["orientation"].split("\\")))
        return

    def change(dataset) -> None:
        dataset.PatientOrientation = new(*dataset.PatientOrientation)

    edit_dicom(path, change)


def spoiled(case: CaseFolder, random: Generator, change: Callable[[Pixels, Generator], Pixels]) -> Effect:
    """Change grey values of one view; the marks stay."""
    view = drawn(case, random)
    path = case.path("image", view)
    old = read_picture(path)
    write_picture(path, change(old, random).astype(old.dtype))
    return Effect(note=view)


def resampled(case: CaseFolder, random: Generator, factor: float) -> Effect:
    """Another export size; the spacing stays that of the old one."""
    view = drawn(case, random)

    def change(pixels: Pixels) -> Pixels:
        return ndimage.zoom(pixels, factor, order=0, grid_mode=True, mode="nearest")

    shift = 0.5 * (factor - 1.0)
    to = np.array([[factor, 0.0, shift], [0.0, factor, shift]])
    moved(case, view, change, to)
    return Effect({view: to}, note=f"{view} times {factor:g}")


def cut(case: CaseFolder, random: Generator, share: float, side: str) -> Effect:
    """Only a part of the picture is left."""
    view = drawn(case, random)
    rows, columns = read_picture(case.path("image", view)).shape
    first = {
        "lower": (round(rows * share), 0),
        "left": (0, 0),
        "right": (0, round(columns * share)),
    }[side]
    last = (rows, columns - round(columns * share)) if side == "left" else (rows, columns)
    to = np.array([[1.0, 0.0, -first[1]], [0.0, 1.0, -first[0]]])
    moved(case, view, lambda p: p[first[0] : last[0], first[1] : last[1]], to)
    return Effect({view: to}, note=f"{view} {share:.0%} cut off at the {side} side")


def _top(pixels: Pixels) -> float:
    return float(np.max(pixels))


def blank(pixels: Pixels, random: Generator) -> Pixels:
    return np.zeros_like(pixels)


def noise(pixels: Pixels, random: Generator) -> Pixels:
    return random.integers(0, max(int(_top(pixels)), 1), size=pixels.shape)


def inverted(pixels: Pixels, random: Generator) -> Pixels:
    return _top(pixels) - pixels


def framed(pixels: Pixels, random: Generator) -> Pixels:
    """A scanned film with a bright frame on three sides."""
    width, found = int(random.integers(8, 24)), pixels.copy()
    found[:width], found[-width:] = _top(pixels), _top(pixels)
    found[:, :width] = _top(pixels)
    return found


def labelled(pixels: Pixels, random: Generator) -> Pixels:
    """A bright label in the corner that is air."""
    found = pixels.copy()
    near = slice(-70, -20) if np.median(pixels[:, :5]) > np.median(pixels[:, -5:]) else slice(20, 70)
    found[20:50, near] = _top(pixels)
    return found


def striped(pixels: Pixels, random: Generator) -> Pixels:
    """Lines of the detector that are dead."""
    found = pixels.copy()
    found[random.integers(0, pixels.shape[0], size=12)] = 0
    return found


def half_black(pixels: Pixels, random: Generator) -> Pixels:
    """A transmission that ended half way."""
    found = pixels.copy()
    found[pixels.shape[0] // 2 :] = 0
    return found


def saturated(pixels: Pixels, random: Generator) -> Pixels:
    return np.where(pixels > np.percentile(pixels, 60), _top(pixels), pixels)


def wrapped(pixels: Pixels, random: Generator) -> Pixels:
    """The low byte alone."""
    return np.asarray(pixels).astype(np.int64) % 256


for _name in ("half a turn", "mirrored", "upside down", "quarter turn"):
    PICTURES.add(f"{_name}, nothing says so", partial(turned, name=_name), times=2)
    PICTURES.add(
        f"{_name}, orientation not given", partial(turned, name=_name, asked=True), bases=("pictures",), times=2
    )
for _factor in (0.5, 0.85, 1.18, 2.0):
    PICTURES.add(f"export size times {_factor:g}", partial(resampled, factor=_factor))
for _side, _share in (("lower", 0.5), ("left", 0.4), ("right", 0.4)):
    PICTURES.add(f"cut at the {_side} side", partial(cut, share=_share, side=_side), bases=("pictures",), times=2)
for _change in (blank, noise, inverted, framed, labelled, striped, half_black, saturated, wrapped):
    PICTURES.add(_change.__name__.replace("_", " "), partial(spoiled, change=_change), times=1)
for _name in ("half a turn", "mirrored", "upside down"):
    PICTURES.add(f"real: {_name}, nothing says so", partial(turned, name=_name), bases=("twin", "victre"))
PICTURES.add("framed", partial(spoiled, change=framed), bases=("both",))
MUTATIONS = PICTURES.found
