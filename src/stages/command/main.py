"""The command `mammoreg`: its parser, and how it ends."""

import argparse
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version

from mammoreg.errors import DataError
from stages.command.by_hand import HelpFormatter, add_check, add_export, add_show, add_stage
from stages.command.importing import add_import
from stages.command.one_case import add_case
from stages.command.running import add_run
from stages.engine.errors import UserError
from stages.engine.outcome import BUG, INTERRUPTED, MISTAKE, USAGE
from stages.engine.threads import compute_with_one_thread

DESCRIPTION = "Find in X-ray mammograms the lesions marked in a breast MR volume, and the other way round."
EPILOG = """examples:
  mammoreg run                                  the embedded cohort of digital patients
  mammoreg import export my_cohort              tables of a folder of DICOM files from a PACS
  mammoreg check cases.tsv views.tsv            look at a cohort without running it
  mammoreg run cases.tsv views.tsv --results my_results
  mammoreg case --mr mr.nii.gz --laterality R --cc cc.dcm --mr-lesion lesion.nii.gz

exit status: 0 done; 1 a mistake or a fault in what was given; 2 the command line is not understood;
3 some case failed, the others and the tables are there; 4 a fault of the program; 130 stopped by Ctrl-C"""

Command = Callable[[argparse.Namespace], int]


def mammoreg_parser() -> argparse.ArgumentParser:
    """The parser of `mammoreg`."""
    parser = argparse.ArgumentParser("mammoreg", description=DESCRIPTION, epilog=EPILOG, formatter_class=HelpFormatter)
    parser.add_argument("--version", action="version", version=f"mammoreg {_version()}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_run(commands)
    add_case(commands)
    add_import(commands)
    add_check(commands, "mammoreg")
    add_stage(commands, "stage", "mammoreg")
    add_show(commands, "mammoreg")
    add_export(commands, "mammoreg")
    return parser


def stages_parser() -> argparse.ArgumentParser:
    """The parser of `python -m stages`."""
    program = "python -m stages"
    text = "The pipeline's stages and artefacts by hand; `mammoreg` runs whole cohorts."
    parser = argparse.ArgumentParser(program, description=text, formatter_class=HelpFormatter)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_stage(commands, "run", program)
    add_check(commands, program)
    add_show(commands, program)
    add_export(commands, program)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `mammoreg`.

    Returns:
        The exit status, as `mammoreg --help` lists them; the parser itself exits with 2.
    """
    return run_command(mammoreg_parser(), arguments)


def run_command(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> int:
    """Parse and run one command; a user's mistake is a message on standard error."""
    compute_with_one_thread()
    given_words = list(sys.argv[1:] if arguments is None else arguments)
    if not given_words:
        parser.print_help(sys.stderr)
        return USAGE
    given = parser.parse_args(given_words)
    command: Command = given.function
    try:
        return command(given)
    except (UserError, DataError) as error:
        print(error, file=sys.stderr)
        return error.outcome if isinstance(error, UserError) else MISTAKE
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has left, as `head` does.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception:
        traceback.print_exc()
        print("mammoreg stopped by a bug: please report the lines above", file=sys.stderr)
        return BUG


def _version() -> str:
    try:
        return version("mammoreg")
    except PackageNotFoundError:
        return "(not installed)"
