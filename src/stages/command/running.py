"""`mammoreg run`: drives Snakemake, and says at the end what came out and how to go on."""

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import Any

from stages.command.by_hand import add_command
from stages.command.home import workflow_home
from stages.command.keys import key_values, path_keys_from
from stages.command.summary import summary
from stages.command.supervised import supervised
from stages.engine.errors import UserError
from stages.engine.outcome import BUG, CASES_FAILED, INTERRUPTED, VARIABLE, worst_outcome
from stages.engine.writing import write_bytes

COMMAND = "MAMMOREG_COMMAND"
"""Environment variable: the command that the user gave, for messages that say how to go on."""
_STATE = ".snakemake"


def add_run(commands: Any) -> None:
    """The command that runs a cohort."""
    parser = add_command(
        commands,
        "run",
        run,
        "run a cohort, the embedded digital one without tables",
        "mammoreg run cases.tsv views.tsv --results my_results --cores 4 --set mesh.elements=10\n"
        "  mammoreg run cases.tsv --target case1/localize     one case, up to one stage\n"
        "  mammoreg run --target table_1                      a study",
    )
    parser.add_argument("cases", type=Path, nargs="?", help="table of the cases, one row per breast")
    parser.add_argument("views", type=Path, nargs="?", help="table of the mammograms")
    parser.add_argument(
        "--target",
        dest="targets",
        action="append",
        default=[],
        help="only this and what it needs: a study, or CASE/STAGE[.VIEW] for an artefact; may be repeated",
    )
    add_run_options(parser)


def add_run_options(parser: Any) -> None:
    """Options that `run` and `case` share."""
    parser.add_argument("--results", type=Path, metavar="FOLDER", help="folder for all results (default: results)")
    parser.add_argument("--cores", default="all", help="jobs at a time, each on one core (default: all)")
    parser.add_argument(
        "--set",
        dest="keys",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a key of the configuration, such as mesh.elements=10; may be repeated",
    )
    parser.add_argument("--config-file", type=Path, metavar="YAML", help="a file with keys of the configuration")
    parser.add_argument("--force", action="store_true", help="make the targets again even if nothing changed")
    parser.add_argument("--dry-run", action="store_true", help="only list what would run, and why")
    parser.add_argument("--verbose", action="store_true", help="all that Snakemake says instead of a bar")
    parser.add_argument("--unlock", action="store_true", help="remove the lock of a run that was killed")
    parser.add_argument(
        "--profile", default="default", help="default, slurm, or the folder of a Snakemake profile (default: default)"
    )


def run(given: argparse.Namespace) -> int:
    """Run a cohort."""
    return run_cohort(given, given.cases, given.views, given.targets)


def run_cohort(given: argparse.Namespace, cases: Path | None, views: Path | None, targets: list[str]) -> int:
    """Run the workflow on two tables.

    Args:
        given: the options of `add_run_options`.
        cases, views: the tables; none for those that the configuration names, or the embedded cohort.
        targets: studies or artefacts; none for the whole cohort.

    Returns:
        The command's exit status.

    Raises:
        UserError: the configuration cannot be read, or the results folder not be used.
    """
    home, values = workflow_home(), key_values(given.config_file, given.keys)
    results = Path(given.results or values.get("results") or "results").absolute()
    values |= {key: str(path.absolute()) for key, path in (("cases", cases), ("views", views)) if path is not None}
    values = path_keys_from(values, Path.cwd()) | {"results": "."}
    _check_results(results)
    _prepare(results, values)
    outcome = results / _STATE / "outcome"
    command = _snakemake(given, home, results, [_target(text, results) for text in targets])
    environment = os.environ | {VARIABLE: str(outcome), COMMAND: _command_line()}
    code, stopped = supervised(command, environment, outcome)
    code = INTERRUPTED if stopped else code and worst_outcome(outcome)
    outcome.unlink(missing_ok=True)
    if code == INTERRUPTED:
        print(f"\nStopped. What is finished is kept; the same command goes on:\n  {_command_line()}", file=sys.stderr)
    elif code in ((0,) if targets else (0, CASES_FAILED, BUG)) and not (given.dry_run or given.unlock):
        print(summary(results, targets), file=sys.stderr)
    return code


def _snakemake(given: argparse.Namespace, home: Path, results: Path, targets: list[str]) -> list[str]:
    named = home / "profiles" / given.profile
    profile = named if named.is_dir() else Path(given.profile)
    if not profile.is_dir():
        raise UserError(f"--profile {given.profile}: there is no such profile; give default, slurm or a folder")
    words = [sys.executable, "-m", "snakemake", *targets, "--snakefile", str(home / "Snakefile")]
    words += ["--directory", str(results), "--workflow-profile", str(profile.absolute())]
    words += ["--configfile", str(results / "logs" / "config.yaml"), "--cores", given.cores]
    flags = {"--dry-run": given.dry_run, "--verbose": given.verbose, "--unlock": given.unlock}
    words += [flag for flag, is_given in flags.items() if is_given]
    if given.force:
        words += ["--force"] if targets else ["--forceall"]
    return words


def _target(text: str, results: Path) -> str:
    """A target as Snakemake, which works in the results folder, knows it: a rule, or a file below that folder."""
    path = Path(text)
    for folder in (results, Path(os.path.relpath(results))):
        if path.is_relative_to(folder):
            path = path.relative_to(folder)
    if len(path.parts) > 1 and path.suffix not in (".h5", ".csv", ".html"):
        path = path.with_name(f"{path.name}.h5")
    return str(path)


def _check_results(results: Path) -> None:
    """Refuse a folder whose results were made by other means: what they were made of is recorded elsewhere."""
    if any(results.glob("*/segment.h5")) and not (results / _STATE).is_dir():
        raise UserError(
            f"{results}: holds results that `snakemake` made from another folder, and their settings are recorded "
            "there; go on with it, or give another folder with --results"
        )


def _prepare(results: Path, values: dict[str, Any]) -> None:
    """Make the results folder and leave the run's keys in it."""
    import yaml

    write_bytes(results / "logs" / "config.yaml", yaml.safe_dump(values, sort_keys=False).encode())
    (results / _STATE).mkdir(exist_ok=True)
    (results / _STATE / "outcome").unlink(missing_ok=True)


def _command_line() -> str:
    """The command as the user gave it."""
    program = "mammoreg" if Path(sys.argv[0]).name == "mammoreg" else f"{shlex.quote(sys.executable)} -m mammoreg"
    return f"{program} {shlex.join(word for word in sys.argv[1:] if word != '--unlock')}"
