"""Why a run ended other than well: each process of a run leaves a note, and the command's exit status is the worst."""

import os
from pathlib import Path

VARIABLE = "MAMMOREG_OUTCOME"

MISTAKE = 1
"""The user's mistake, or faults in what was handed in."""
USAGE = 2
"""The command line cannot be understood."""
CASES_FAILED = 3
"""Some case failed; the others and the tables are there."""
BUG = 4
"""A fault of the program."""
INTERRUPTED = 130
"""Stopped by the user."""


def start_outcome() -> None:
    """Make the file for the notes: from here on the run can be interrupted without a traceback."""
    path = os.environ.get(VARIABLE)
    if path:
        Path(path).touch()


def note_outcome(code: int) -> None:
    """Leave a note for the command that started this run, where one did."""
    path = os.environ.get(VARIABLE)
    if path:
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(f"{code}\n")


def worst_outcome(path: Path) -> int:
    """The worst of a run's notes, `MISTAKE` without any."""
    notes = path.read_text(encoding="utf-8").split() if path.exists() else []
    return max(map(int, notes), default=MISTAKE)
