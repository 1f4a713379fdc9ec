"""Bytes that a disk, a network or an editor has damaged, in any file."""

import shutil
from functools import partial

import numpy as np
from numpy.random import Generator

from tests.mutants.case_folder import CaseFolder, Effect
from tests.mutants.mutations.registry import Mutations

HEADER_BYTES = {"image": 2400, "mr": 352}
DAMAGE = Mutations("damaged bytes", ("nifti",))
# Column, view and bases whose file of that column is worth damaging.
FILES = (
    ("mr", None, ("nifti", "both")),
    ("mr", "slice", ("dicom",)),
    ("image", "CC", ("nifti", "pictures")),
    ("image", "MLO", ("nifti",)),
    ("mr_lesion", None, ("nifti", "pictures")),
    ("lesion", "CC", ("nifti", "pictures")),
)


def _bytes(case: CaseFolder, random: Generator, column: str, view: str | None):
    slices = case.slices() if view == "slice" else []
    path = slices[int(random.integers(len(slices)))] if slices else case.path(column, view)
    return path, bytearray(path.read_bytes())


def truncate(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, content = _bytes(case, random, column, view)
    kept = int(len(content) * random.uniform(0.02, 0.98))
    path.write_bytes(content[:kept])
    return Effect(note=f"{column} {view or ''} cut to {kept / len(content):.0%}")


def flip_in_header(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, content = _bytes(case, random, column, view)
    end = min(len(content), HEADER_BYTES["image" if path.suffix == ".dcm" else "mr"])
    start = 132 if path.suffix == ".dcm" else 0
    places = random.integers(start, end, size=3)
    for place in places:
        content[place] ^= int(random.integers(1, 256))
    path.write_bytes(content)
    return Effect(note=f"{column} {view or ''} bytes {', '.join(map(str, places))}")


def flip_anywhere(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, content = _bytes(case, random, column, view)
    for place in random.integers(0, len(content), size=20):
        content[place] ^= 1 << int(random.integers(8))
    path.write_bytes(content)
    return Effect(note=f"{column} {view or ''}, 20 bits")


def zero_a_block(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, content = _bytes(case, random, column, view)
    size = min(4096, len(content) // 2)
    start = int(random.integers(0, len(content) - size))
    content[start : start + size] = bytes(size)
    path.write_bytes(content)
    return Effect(note=f"{column} {view or ''}, {size} zeros at {start}")


def empty(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, _ = _bytes(case, random, column, view)
    path.write_bytes(b"")
    return Effect(note=f"{column} {view or ''} empty")


def error_page(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, _ = _bytes(case, random, column, view)
    path.write_text("<html><body>404: the image was not found on this server</body></html>\n")
    return Effect(note=f"{column} {view or ''} is a web page")


def missing(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, _ = _bytes(case, random, column, view)
    path.unlink()
    return Effect(note=f"{column} {view or ''} gone")


def folder(case: CaseFolder, random: Generator, column: str, view: str | None) -> Effect:
    path, _ = _bytes(case, random, column, view)
    path.unlink()
    path.mkdir()
    return Effect(note=f"{column} {view or ''} is an empty folder")


def exchange(case: CaseFolder, random: Generator, column: str) -> Effect:
    """The files of both views in each other's place."""
    one, other = (case.path(column, view) for view in ("CC", "MLO"))
    kept = one.with_name("kept")
    shutil.move(one, kept)
    shutil.move(other, one)
    shutil.move(kept, other)
    return Effect(note=f"{column} of CC and MLO exchanged")


def uncompressed_samples(case: CaseFolder, random: Generator) -> Effect:
    """Bits of the voxels of an uncompressed volume, which no checksum guards."""
    import gzip

    path = case.path("mr", suffix=".nii.gz")
    content = bytearray(gzip.decompress(path.read_bytes()))
    for place in random.integers(352, len(content), size=50):
        content[place] ^= 1 << int(random.integers(8))
    case.rename("mr", None, "mr.nii").write_bytes(content)
    return Effect(note="50 bits of the voxels")


def uncompressed_header(case: CaseFolder, random: Generator) -> Effect:
    import gzip

    path = case.path("mr", suffix=".nii.gz")
    content = bytearray(gzip.decompress(path.read_bytes()))
    # Sizes, types, scales and the affine; not the free texts.
    places = random.choice(np.r_[0:4, 40:56, 70:124, 252:328], size=2, replace=False)
    for place in places:
        content[place] ^= int(random.integers(1, 256))
    case.rename("mr", None, "mr.nii").write_bytes(content)
    return Effect(note=f"header bytes {', '.join(map(str, places))}")


for _column, _view, _bases in FILES:
    for _name, _change, _times in (
        ("truncated", truncate, 2),
        ("three bytes of the header changed", flip_in_header, 3),
        ("bits flipped", flip_anywhere, 2),
        ("block of zeros", zero_a_block, 1),
        ("empty", empty, 1),
        ("a web page", error_page, 1),
        ("gone", missing, 1),
        ("a folder", folder, 1),
    ):
        if _view == "slice" and _name in ("gone", "a folder"):
            continue
        _once = _bases[:1] if _times == 1 else _bases
        _done = partial(_change, column=_column, view=_view)
        DAMAGE.add(f"{_column} {_view or ''}".strip() + f": {_name}", _done, bases=_once, times=_times)
for _column in ("image", "lesion"):
    DAMAGE.add(f"{_column}: views exchanged", partial(exchange, column=_column), bases=("nifti", "pictures", "both"))
DAMAGE.add("mr: header of an uncompressed volume", uncompressed_header, times=14)
DAMAGE.add("mr: voxels of an uncompressed volume", uncompressed_samples, times=2)
MUTATIONS = DAMAGE.found
