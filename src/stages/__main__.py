"""`python -m stages run|check|show|export`: the pipeline's stages and artefacts by hand."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from stages.engine.errors import FaultsError, UserError
from stages.engine.threads import compute_with_one_thread


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; a user's mistake is a message on standard error and the exit status 1."""
    compute_with_one_thread()
    given = _parser().parse_args(arguments)
    try:
        return int(given.command(given))
    except UserError as error:
        print(error, file=sys.stderr)
        return 1


def _run(given: argparse.Namespace) -> int:
    from stages.engine.contract import Subject
    from stages.engine.run import run_stage

    inputs: dict[str, Path | list[Path]] = {}
    for name, path in map(_pair, given.inputs):
        before = inputs.get(name)
        inputs[name] = (
            Path(path) if before is None else [*(before if isinstance(before, list) else [before]), Path(path)]
        )
    subject = Subject(given.case, given.laterality, given.view, dict(map(_pair, given.row)))
    fields = run_stage(given.stage, inputs, given.out, _settings(given.settings), subject)
    print(f"{given.out}: {fields.status}{f' ({fields.message})' if fields.message else ''}")
    return 1 if fields.status == "bug" else 0


def _check(given: argparse.Namespace) -> int:
    from stages.cohort.cases import read_cohort
    from stages.cohort.preflight import check_cohort

    cohort = read_cohort(given.cases, given.views)
    if faults := check_cohort(cohort):
        raise FaultsError(faults)
    print(f"{len(cohort.cases)} cases and {len(cohort.mammograms)} mammograms, nothing to mend")
    return 0


def _show(given: argparse.Namespace) -> int:
    from stages.engine.artefact import Artefact
    from stages.showing import describe

    print("\n\n".join(describe(Artefact(path)) for path in given.artefacts))
    return 0


def _export(given: argparse.Namespace) -> int:
    from stages.engine.artefact import Artefact
    from stages.formats.exporting import export_artefact

    for path in export_artefact(Artefact(given.artefact), given.to):
        print(path)
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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m stages", description=__doc__)
    commands = parser.add_subparsers(required=True)
    run = commands.add_parser("run", help="run one stage, as the first line of its log says")
    run.add_argument("stage")
    run.add_argument("--case", default="cohort")
    run.add_argument("--laterality", choices=("L", "R"), default="R")
    run.add_argument("--view", choices=("CC", "MLO", "3D"))
    run.add_argument("--row", action="append", default=[], metavar="COLUMN=VALUE", help="a value of the tables")
    run.add_argument("--in", dest="inputs", action="append", default=[], metavar="NAME=PATH")
    run.add_argument("--settings", default="{}", metavar="JSON")
    run.add_argument("--out", type=Path, required=True)
    run.set_defaults(command=_run)
    check = commands.add_parser("check", help="check a cohort's tables and files without running it")
    check.add_argument("cases", type=Path)
    check.add_argument("views", type=Path, nargs="?")
    check.set_defaults(command=_check)
    show = commands.add_parser("show", help="show artefacts as a person reads them")
    show.add_argument("artefacts", type=Path, nargs="+")
    show.set_defaults(command=_show)
    export = commands.add_parser("export", help="write meshes as VTU, volumes as NIfTI, tables as CSV")
    export.add_argument("artefact", type=Path)
    export.add_argument("--to", type=Path, required=True, metavar="FOLDER")
    export.set_defaults(command=_export)
    return parser


if __name__ == "__main__":
    sys.exit(main())
