"""CalculiX beside the project's solver: its input decks read, its program run, its displacements read."""

import gzip
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
DECKS = Path("/usr/share/doc/calculix-ccx-test/examples/test")
CCX = shutil.which("ccx")


@dataclass(frozen=True)
class Deck:
    """An input deck.

    Attributes:
        text: as CalculiX reads it.
        numbers: of the nodes (N,), ascending.
        points: their places (N, 3).
        hexes: corners (E, 8) of its 20-node hexahedra, as rows of `points`, VTK order.
    """

    text: str
    numbers: Indices
    points: Floats
    hexes: Indices


def requires_ccx(deck: str) -> pytest.MarkDecorator:
    """Skip visibly without the program (Debian: calculix-ccx) or its test decks (calculix-ccx-test)."""
    if CCX is None:
        return pytest.mark.skip(reason="ccx is not on the PATH (Debian: calculix-ccx)")
    found = deck_path(deck) is not None
    return pytest.mark.skipif(not found, reason=f"no {deck} in {DECKS} (Debian: calculix-ccx-test; or CCX_TEST_DECKS)")


def deck_path(name: str) -> Path | None:
    """The deck among Debian's test decks, or in the folder that CCX_TEST_DECKS names; as it is or gzipped."""
    folder = Path(os.environ.get("CCX_TEST_DECKS", DECKS))
    return next((path for path in (folder / name, folder / f"{name}.gz") if path.exists()), None)


def read_deck(name: str) -> Deck:
    path = deck_path(name)
    assert path is not None
    data = path.read_bytes()
    text = (gzip.decompress(data) if path.suffix == ".gz" else data).decode("ascii")
    nodes = np.array([row for row in _block(text, "*NODE") if len(row) == 4])
    order = np.argsort(nodes[:, 0])
    numbers, points = nodes[order, 0].astype(np.int64), nodes[order, 1:]
    elements = np.concatenate(_block(text, "*ELEMENT,")).astype(np.int64).reshape(-1, 21)
    # The first eight of the 20 nodes are the corners, in the order of VTK.
    return Deck(text, numbers, points, np.searchsorted(numbers, elements[:, 1:9]))


def run_ccx(text: str, folder: Path) -> Floats:
    """Displacements (N, 3) by ascending node number at the end of a deck's step; it must print U of all nodes."""
    assert CCX is not None
    (folder / "deck.inp").write_text(text)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [CCX, "deck"], cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]
    tables = (folder / "deck.dat").read_text().split(" displacements ")
    assert len(tables) > 1, done.stdout[-2000:]
    rows = []
    for line in tables[-1].splitlines()[1:]:
        fields = line.split()
        if len(fields) == 4:
            rows.append([float(field) for field in fields])
        elif fields:
            break
    table = np.array(rows)
    return np.asarray(table[np.argsort(table[:, 0]), 1:])


def _block(text: str, keyword: str) -> list[Floats]:
    """The data lines of the first block that a keyword opens, as numbers."""
    lines, inside, rows = text.splitlines(), False, []
    for line in lines:
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            if inside:
                break
            head = line.upper().replace(" ", "")
            inside = head == keyword or (keyword.endswith(",") and head.startswith(keyword))
        elif inside:
            rows.append(np.array([float(field) for field in line.split(",") if field.strip()]))
    return rows
