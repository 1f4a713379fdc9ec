"""What a rule of the workflow calls: its log, the stage, and a line on the terminal when a case is done."""

import logging
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TextIO

from stages.engine.errors import UserError
from stages.engine.threads import compute_with_one_thread

LAST_OF_A_CASE = "figures"


class Job(Protocol):
    """What Snakemake hands to a script."""

    rule: str
    input: Any
    output: Any
    params: Any
    log: Any
    config: Any


def run_job(job: Job) -> None:
    """Run a rule's stage (its parameter `stage`, else its name); the log's first line is the same as a command."""
    compute_with_one_thread()
    from stages.engine.contract import Subject
    from stages.engine.run import command_line, run_stage

    stage = str(job.params.get("stage", job.rule))
    inputs, output, settings = _inputs(job), Path(job.output[0]), dict(job.params.settings)
    subject = Subject(**job.params.subject)

    def work(terminal: TextIO) -> None:
        print(command_line(stage, inputs, output, settings, subject), flush=True)
        fields = run_stage(stage, inputs, output, settings, subject)
        if fields.failure and (fields.failure.stage, fields.failure.view) == (stage, subject.view or ""):
            where = f"{subject.case} {subject.view}" if subject.view else subject.case
            print(f"{where} {fields.status}: {fields.message}", file=terminal, flush=True)
        if stage == LAST_OF_A_CASE:
            print(_progress(subject.case, fields.status, output, job.config["case_count"]), file=terminal, flush=True)

    _logged(job, work)


def _progress(case: str, status: str, output: Path, count: int) -> str:
    done = len(list(output.parent.parent.glob(f"*/{output.name}")))
    return f"{case}: case done ({status}); {done} of {count} cases"


def run_complete(job: Job) -> None:
    """Write the file that says that no case failed, or name the failures and end non-zero."""
    from stages.engine.completion import write_completion

    def work(terminal: TextIO) -> None:
        write_completion([Path(path) for path in job.input.cases], Path(job.output[0]))
        print("all cases complete", file=terminal, flush=True)

    _logged(job, work)


def _inputs(job: Job) -> Mapping[str, Path | list[Path]]:
    """Paths by input name; the files of a DICOM folder become the folder again."""
    from stages.engine.registry import STAGE_MODULES

    found: dict[str, Path | list[Path]] = {}
    for name, paths in job.input.items():
        if isinstance(paths, str):
            found[name] = Path(paths)
        elif name in STAGE_MODULES:
            found[name] = [Path(path) for path in paths]
        else:
            found[name] = Path(paths[0]).parent
    return found


def _logged(job: Job, work: Callable[[TextIO], None]) -> None:
    with _output_to(Path(job.log[0])) as terminal:
        # No clock: a log of the same job is the same. Tracebacks of bad data come at the level INFO.
        logging.basicConfig(stream=sys.stderr, format="%(message)s")
        logging.getLogger("stages").setLevel(logging.INFO)
        try:
            work(terminal)
        except Exception as error:
            traceback.print_exc()
            name = f"{job.rule}: " if isinstance(error, UserError) else f"{job.rule} stopped by a bug: "
            print(f"{name}{error}\nlog: {job.log[0]}", file=terminal, flush=True)
            sys.exit(1)


@contextmanager
def _output_to(log: Path) -> Iterator[TextIO]:
    """Send all output of this process, that of libraries too, to a file; yields the terminal."""
    sys.stdout.flush()
    sys.stderr.flush()
    terminal_descriptor = os.dup(2)
    with os.fdopen(terminal_descriptor, "w") as terminal, log.open("w", encoding="utf-8") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
        try:
            yield terminal
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(terminal_descriptor, 1)
            os.dup2(terminal_descriptor, 2)
