"""What `mammoreg` and `python -m stages` share: one stage, check, show, export."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stages.engine.errors import FaultsError, UserError
from stages.engine.outcome import BUG


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Keeps the lines of an example."""


def add_command(
    commands: Any, name: str, function: Callable[[argparse.Namespace], int], text: str, example: str
) -> argparse.ArgumentParser:
    """A command with its help and an example."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example:\n  {example}",
        formatter_class=HelpFormatter,
    )
    parser.set_defaults(function=function)
    return parser


def add_stage(commands: Any, name: str, program: str) -> None:
    """The command that runs one stage."""
    parser = add_command(
        commands,
        name,
        run_stage_by_hand,
        "run one stage, as the first line of its log says",
        f"{program} {name} mesh --case a --laterality R --in segment=results/a/segment.h5 --out mesh.h5",
    )
    parser.add_argument("stage", help="name of the stage")
    parser.add_argument("--case", default="cohort", help="id of the case (default: cohort, a stage that has none)")
    parser.add_argument("--laterality", choices=("L", "R"), default="R", help="side of the breast")
    parser.add_argument("--view", help="the view, for a stage that runs once per view: CC, MLO, ..., or 3D")
    parser.add_argument(
        "--row", action="append", default=[], metavar="COLUMN=VALUE", help="a value of the tables; may be repeated"
    )
    parser.add_argument(
        "--in",
        dest="inputs",
        action="append",
        default=[],
        metavar="NAME=PATH",
        help="an input: a stage's artefact or a file, by the name of its stage or column; may be repeated",
    )
    parser.add_argument(
        "--settings", default="{}", metavar="JSON", help="the stage's settings, such as '{\"elements\": 7}'"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="PATH", help="the artefact to write")


def add_check(commands: Any, program: str) -> None:
    """The command that checks a cohort."""
    parser = add_command(
        commands,
        "check",
        check,
        "check a cohort's tables and every file that they name, without running it",
        f"{program} check cases.tsv views.tsv",
    )
    parser.add_argument("cases", type=Path, help="table of the cases, one row per breast")
    parser.add_argument("views", type=Path, nargs="?", help="table of the mammograms")


def add_show(commands: Any, program: str) -> None:
    """The command that shows artefacts."""
    parser = add_command(
        commands,
        "show",
        show,
        "show artefacts (the .h5 files that stages leave) as a person reads them, predictions as tables",
        f"{program} show results/a/localize.h5",
    )
    parser.add_argument("artefacts", type=Path, nargs="+", help="artefacts, <results>/<case>/<stage>[.<view>].h5")


def add_export(commands: Any, program: str) -> None:
    """The command that exports an artefact."""
    parser = add_command(
        commands,
        "export",
        export,
        "write what an artefact holds for other programs, in patient coordinates: meshes, volumes, images and tables",
        f"{program} export results/a/mesh.h5 --to out",
    )
    parser.add_argument("artefact", type=Path, help="an artefact, <results>/<case>/<stage>[.<view>].h5")
    parser.add_argument("--to", type=Path, required=True, metavar="FOLDER", help="where to; it is made")


def run_stage_by_hand(given: argparse.Namespace) -> int:
    """Run one stage and say how it ended."""
    from stages.engine.contract import Subject
    from stages.engine.run import run_stage
    from stages.engine.stage_log import log_to_terminal

    inputs: dict[str, Path | list[Path]] = {}
    for name, path in map(_pair, given.inputs):
        before = inputs.get(name)
        inputs[name] = (
            Path(path) if before is None else [*(before if isinstance(before, list) else [before]), Path(path)]
        )
    subject = Subject(given.case, given.laterality, given.view, dict(map(_pair, given.row)))
    log_to_terminal()
    fields = run_stage(given.stage, inputs, given.out, _settings(given.settings), subject)
    print(f"{given.out}: {fields.status}{f' ({fields.message})' if fields.message else ''}")
    return BUG if fields.status == "bug" else 0


def check(given: argparse.Namespace) -> int:
    """Check tables and files; faults are an error, what only looks odd is printed."""
    from stages.cohort.cases import read_cohort
    from stages.cohort.preflight import check_cohort, choices_of, warnings_of

    cohort = read_cohort(given.cases, given.views)
    if faults := check_cohort(cohort):
        raise FaultsError(faults)
    for line in choices_of(cohort):
        print(line)
    for warning in warnings_of(cohort):
        print(f"warning: {warning}")
    print(f"{len(cohort.cases)} cases and {len(cohort.mammograms)} mammograms, nothing to mend")
    return 0


def show(given: argparse.Namespace) -> int:
    """Print artefacts."""
    from stages.engine.artefact import Artefact
    from stages.showing import describe

    print("\n\n".join(describe(Artefact(path)) for path in given.artefacts))
    return 0


def export(given: argparse.Namespace) -> int:
    """Export an artefact and name the files."""
    from stages.engine.artefact import Artefact
    from stages.formats.exporting import export_artefact

    paths, left_out = export_artefact(Artefact(given.artefact), given.to)
    for path in paths:
        print(path)
    for reason in left_out:
        print(f"not written: {reason}", file=sys.stderr)
    return 0


def _settings(text: str) -> dict[str, object]:
    try:
        return dict(json.loads(text))
    except ValueError as error:
        raise UserError(f"--settings is no JSON object ({error}); write it as '{{\"key\": value}}'") from error


def _pair(text: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign:
        raise UserError(f"{text!r} is no pair; write name=value")
    return name, value
