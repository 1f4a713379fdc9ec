"""Snakemake's logger plugin `mammoreg`: a bar with the time left, and messages in a user's words.

Snakemake finds it by this module's name; `profiles/default` asks for it. With `--verbose` and in a dry run all that
Snakemake says is shown as it says it.
"""

import os
import sys
from logging import WARNING, LogRecord
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from stages.command.progress import Progress
from stages.command.snakemake_words import is_chatter, killed_by, lock_message, mistake_within, plain
from stages.engine.outcome import BUG, MISTAKE, note_outcome, start_outcome

COMMAND = "MAMMOREG_COMMAND"
_STEP = 0.1
_STOPPED = ("SIGINT", "SIGTERM")
# Snakemake's names of what a user can mend; any other exception in the workflow's files is a bug.
_MISTAKES = (
    "WorkflowError",
    "LockException",
    "MissingRuleException",
    "CliException",
    "ApiError",
    "MissingInputException",
)


class LogHandler(LogHandlerBase):  # type: ignore[misc]
    """Shows a run."""

    def __post_init__(self) -> None:
        """Start with nothing known of the run."""
        self._as_told = self.common_settings.verbose or self.common_settings.dryrun
        self._stream = sys.stdout if self.common_settings.stdout else sys.stderr
        self._jobs: dict[int, tuple[str, str]] = {}
        self._progress: Progress | None = None
        self._told = 0.0
        self._bar: Bar | None = None
        self._failed = False
        self._stopped = False
        sys.excepthook = _quiet_when_interrupted
        start_outcome()

    @property
    def writes_to_stream(self) -> bool:
        """It takes the place of Snakemake's own."""
        return True

    @property
    def writes_to_file(self) -> bool:
        """Snakemake's own log file stays."""
        return False

    @property
    def has_filter(self) -> bool:
        """Snakemake's default filter is kept."""
        return False

    @property
    def has_formatter(self) -> bool:
        """Snakemake's default formatter is kept."""
        return False

    @property
    def needs_rulegraph(self) -> bool:
        """No picture is drawn."""
        return False

    def emit(self, record: LogRecord) -> None:
        """Show one record, or count it."""
        try:
            self._note_outcome(record)
            is_error = getattr(record, "event", None) == LogEvent.ERROR
            if self._as_told and (self.common_settings.verbose or not is_error):
                self._write(self.format(record))
            else:
                self._show(record)
        except Exception:
            self.handleError(record)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        super().close()

    def _note_outcome(self, record: LogRecord) -> None:
        """Note what ends a run before or beside its jobs; a job notes its own end."""
        name = getattr(record, "exception", "")
        if getattr(record, "event", None) == LogEvent.ERROR and name != "RuleException" and not self._failed:
            mistake = name in _MISTAKES or mistake_within(record.getMessage()) is not None
            note_outcome(MISTAKE if mistake else BUG)
        self._failed |= name == "RuleException"

    def _show(self, record: LogRecord) -> None:
        event = getattr(record, "event", None)
        shown = {
            LogEvent.RUN_INFO: self._start,
            LogEvent.JOB_INFO: self._know,
            LogEvent.JOB_FINISHED: self._finish,
            LogEvent.JOB_ERROR: self._fail,
            LogEvent.ERROR: self._error,
        }
        if event in shown:
            shown[event](record)
        elif event is None and (record.levelno >= WARNING or not is_chatter(record.getMessage())):
            text = record.getMessage()
            if not is_chatter(text):
                self._write(plain(text))

    def _start(self, record: Any) -> None:
        jobs = {rule: count for rule, count in record.stats.items() if rule != "total"}
        self._progress = Progress(jobs)
        if self._stream.isatty() and self._bar is None:
            columns = (BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TextColumn("{task.description}"))
            self._bar = Bar(*columns, console=Console(file=self._stream), transient=True)
            self._bar.add_task("", total=1.0)
            self._bar.start()
        elif self._bar is None:
            self._write(f"{record.stats['total']} steps to do")

    def _know(self, record: Any) -> None:
        self._jobs[record.jobid] = (record.rule_name, record.rule_msg or record.rule_name)

    def _finish(self, record: Any) -> None:
        rule, _ = self._jobs.get(record.job_id, ("", ""))
        if self._progress is None:
            return
        self._progress.finish(rule)
        share, left = self._progress.share, self._progress.left
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=share, description=left)
        elif share >= self._told + _STEP and share < 1.0:
            self._told = share
            self._write(f"{int(100 * share)} % done, {left}")

    def _fail(self, record: Any) -> None:
        rule, what = self._jobs.get(record.jobid, (record.rule_name, record.rule_name))
        if rule != "complete" and record.log and not self._stopped:
            self._write(f"{what} did not finish; its log: {Path(record.log[0]).absolute()}")

    def _error(self, record: Any) -> None:
        text, name = record.getMessage(), getattr(record, "exception", "")
        signal = killed_by(text)
        # A job's exception comes before the message that the job failed.
        self._stopped = signal in _STOPPED
        if name == "LockException":
            self._write(lock_message(str(Path.cwd()), os.environ.get(COMMAND)))
        elif signal and signal not in _STOPPED:
            why = "; the system does so when memory runs out" if signal == "SIGKILL" else ""
            self._write(f"a job was ended by {signal}{why}; run again with fewer cores")
        elif name != "RuleException" and not is_chatter(plain(text)):
            self._write(mistake_within(text) or (plain(text) if name in _MISTAKES else text))

    def _write(self, text: str) -> None:
        if not text or text == "None":
            return
        if self._bar is not None:
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=self._stream, flush=True)


def _quiet_when_interrupted(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Ctrl-C is no bug: nothing to trace."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
