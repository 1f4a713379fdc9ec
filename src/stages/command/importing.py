"""`mammoreg import`: from a folder of DICOM, as a PACS exports it, to the two tables."""

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from stages.command.by_hand import add_command
from stages.engine.errors import UserError

_MOST_LINES = 12


def add_import(commands: Any) -> None:
    """The command that makes tables of a folder."""
    parser = add_command(
        commands,
        "import",
        run_import,
        "make both tables of a folder of DICOM files, one or many patients as a PACS exports them",
        "mammoreg import export my_cohort\n"
        "  mammoreg check my_cohort/cases.tsv my_cohort/views.tsv\n\n"
        "my_cohort/import.tsv lists all that was found, what it is used for, and why the rest was left.\n"
        "Without --link nothing in my_cohort names a patient: MR volumes become NIfTI files, mammograms\n"
        "copies with the pixels and how they were taken. Text that is part of a picture stays.",
    )
    parser.add_argument("folder", type=Path, help="folder of DICOM files, searched with its subfolders")
    parser.add_argument("out", type=Path, help="folder for the tables and files; it must not be there yet")
    parser.add_argument(
        "--link",
        action="store_true",
        help="link to the files instead of copying them; they keep their headers, and the links the files' names",
    )
    parser.add_argument(
        "--with-paths", action="store_true", help="name the files in import.tsv; their names may name patients"
    )


def run_import(given: argparse.Namespace) -> int:
    """Find, pair, write, and say what came out."""
    from stages.importing.found import find
    from stages.importing.plan import plan
    from stages.importing.writing import ACCOUNT, CASES, VIEWS, write_import

    if not given.folder.is_dir():
        raise UserError(f"{given.folder}: is no folder; name the one that holds the DICOM files")
    found = find(given.folder, lambda files: _shown(files, "headers read"))
    planned = plan(found)
    if not planned.breasts:
        raise UserError(f"{given.folder}: holds no breast with MR and a mammogram{_reasons(planned.entries)}")
    written = write_import(
        planned,
        given.out,
        lambda breasts: _shown(breasts, "breasts written"),
        link=given.link,
        with_paths=given.with_paths,
    )
    views = sum(len(breast.images) for breast in written)
    left = sum(entry.used_for == "" for entry in planned.entries) + len(planned.breasts) - len(written)
    counts = _count(len(written), "breast"), _count(views, "mammogram"), _count(len(found.patients), "patient")
    print(f"{counts[0]} with {counts[1]}, of {counts[2]} found: {given.out}")
    print(f"{_count(left, 'line')} of {given.out / ACCOUNT} say what was left, and why")
    for path, reason in found.unread:
        print(f"not read: {path}: {reason}", file=sys.stderr)
    print(f"look at them next: mammoreg check {given.out / CASES} {given.out / VIEWS}")
    return 0


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'' if number == 1 else 's'}"


def _reasons(entries: Sequence[Any]) -> str:
    """Why nothing came of what was found, a line each."""
    if not entries:
        return "; nothing in it is DICOM"
    lines = [f"\n  {entry.patient} {entry.what}: {entry.why}" for entry in entries[:_MOST_LINES]]
    more = f"\n  and {len(entries) - _MOST_LINES} more" if len(entries) > _MOST_LINES else ""
    return f", and nothing is written:{''.join(lines)}{more}"


Item = TypeVar("Item")


def _shown(items: Sequence[Item], what: str) -> Iterable[Item]:
    """The items one by one, with a bar on a terminal."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return track(items, what, total=len(items), console=console, transient=True, disable=not console.is_terminal)
