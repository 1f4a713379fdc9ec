"""What a rule of the workflow calls: its log, the stage, and a line on the terminal when a case is done."""

import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TextIO

from stages.engine.errors import UserError
from stages.engine.outcome import BUG, INTERRUPTED, note_outcome
from stages.engine.threads import compute_with_one_thread

LAST_OF_A_CASE = "figures"
_CLEAR_LINE = "\r\033[2K"


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
    from stages.engine.stage_log import log_to

    stage = str(job.params.get("stage", job.rule))
    inputs, output, settings = _inputs(job), Path(job.output[0]), dict(job.params.settings)
    subject = Subject(**job.params.subject)

    def work(terminal: TextIO) -> None:
        log_to(sys.stdout)
        print(command_line(stage, inputs, output, settings, subject), flush=True)
        fields = run_stage(stage, inputs, output, settings, subject)
        if fields.failure and (fields.failure.stage, fields.failure.view) == (stage, subject.view or ""):
            where = f"{subject.case} {subject.view}" if subject.view else subject.case
            tell(terminal, f"{where} {fields.status}: {fields.message}")
        if stage == LAST_OF_A_CASE:
            tell(terminal, _progress(subject.case, fields.status, output, job.config["case_count"]))

    _logged(job, work)


def _progress(case: str, status: str, output: Path, count: int) -> str:
    done = len(list(output.parent.parent.glob(f"*/{output.name}")))
    return f"{case}: case done ({status}); {done} of {count} cases"


def run_complete(job: Job) -> None:
    """Write the file that says that no case failed, or name the failures and end non-zero."""
    from stages.engine.completion import write_completion

    def work(terminal: TextIO) -> None:
        write_completion([Path(path) for path in job.input.cases], Path(job.output[0]))
        tell(terminal, "all cases complete")

    _logged(job, work)


def _inputs(job: Job) -> Mapping[str, Path | list[Path]]:
    """Paths by input name; a folder, or a file that Snakemake knows by another name, has its own again."""
    from stages.engine.registry import STAGE_MODULES

    sources = dict(job.params.get("sources", {}))
    found: dict[str, Path | list[Path]] = {}
    for name, paths in job.input.items():
        if name in sources:
            found[name] = Path(sources[name])
        elif isinstance(paths, str):
            found[name] = Path(paths)
        elif name in STAGE_MODULES:
            found[name] = [Path(path) for path in paths]
        else:
            found[name] = Path(paths[0]).parent
    return found


def _logged(job: Job, work: Callable[[TextIO], None]) -> None:
    with _output_to(Path(job.log[0])) as terminal:
        try:
            work(terminal)
        except KeyboardInterrupt:
            sys.exit(INTERRUPTED)
        except Exception as error:
            traceback.print_exc()
            note_outcome(error.outcome if isinstance(error, UserError) else BUG)
            by_bug = "" if isinstance(error, UserError) else " stopped by a bug"
            tell(terminal, f"{job.rule}{by_bug}: {error}")
            sys.exit(1)


def tell(terminal: TextIO, text: str) -> None:
    """Write to the terminal in one piece; where it shows a bar, in the bar's place, which is drawn again below."""
    terminal.write(f"{_CLEAR_LINE if terminal.isatty() else ''}{text}\n")
    terminal.flush()


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
