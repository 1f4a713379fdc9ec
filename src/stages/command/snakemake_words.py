"""Snakemake's messages in a user's words: no exception's name, no traceback, no list of files."""

import re
import textwrap

_CHATTER = (
    "Config file ",
    "Assuming unrestricted shared filesystem",
    "Building DAG of jobs",
    "Using shell:",
    "Provided cores:",
    "Provided resources:",
    "Rules claiming more threads",
    "Job stats:",
    "Select jobs to execute",
    "Execute ",
    "Complete log(s):",
    "Shutting down, this might take some time",
    "Will exit after finishing currently running jobs",
    "Terminating processes on user request",
    "Cancelling snakemake on user request",
    "Exiting because a job execution failed",
    "At least one job did not complete successfully",
    "Workflow finished",
    "Elapsed time",
    "Touching output file",
    "Removing output files of failed job",
    "Workflow has started",
    "host:",
)
_EXCEPTION = re.compile(r"\A(Error: )?[A-Za-z]*(Error|Exception)( in (rule|file) .*?)?(, line \d+)?:\n", re.DOTALL)
_NO_TARGET = re.compile(r"^No rule to produce (.*?) \(if you use input functions .*$", re.MULTILINE)
_FRAME = re.compile(r'^ *(File ".*", line \d+, in .*|Traceback \(most recent call last\):)$')


def is_chatter(text: str) -> bool:
    """Whether a message tells a user nothing that the bar does not."""
    return not text.strip() or text.lstrip("[ ").removeprefix("WorkflowError:\n").startswith(_CHATTER)


def plain(text: str) -> str:
    """A message without the exception that carried it and the places in the code that it passed."""
    lines = [line for line in _EXCEPTION.sub("", text).splitlines() if not _FRAME.match(line)]
    no_target = r"there is no target \1; give a study such as table_1, or a file such as a case's localize.h5"
    return _NO_TARGET.sub(no_target, "\n".join(lines).strip())


def mistake_within(text: str) -> str | None:
    """The message of a mistake that Snakemake met while it asked for a rule's inputs; None if it was another error."""
    found = re.search(r"InputFunctionException.*?^ +WorkflowError:\n(.*?)^Wildcards:", text, re.DOTALL | re.MULTILINE)
    return textwrap.dedent(found.group(1)).strip() if found else None


def killed_by(text: str) -> str | None:
    """What ended a job that did not end by itself; None if it did."""
    found = re.search(r"died with <Signals\.(SIG\w+)", text)
    signal = found.group(1) if found else None
    if signal is None and (status := re.search(r"non-zero exit status (\d+)", text)) and int(status.group(1)) > 128:
        signal = {137: "SIGKILL", 143: "SIGTERM", 130: "SIGINT", 139: "SIGSEGV"}.get(int(status.group(1)), "a signal")
    return signal


def lock_message(folder: str, command: str | None) -> str:
    """What a lock means, and what to do about it.

    Args:
        folder: the locked one.
        command: of the user, without `--unlock`; None where Snakemake was called itself.
    """
    again = command or "the same snakemake command"
    return (
        f"{folder} is locked: another run is at work in it, or one was killed and could not remove its lock.\n"
        f"If another is at work, wait for it. If none is, remove the lock and go on; what is finished is kept:\n"
        f"  {again} --unlock\n  {again}"
    )
