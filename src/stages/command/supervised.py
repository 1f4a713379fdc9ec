"""Snakemake as a child process that Ctrl-C stops cleanly."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType

import psutil

_POLL_S = 0.2
_SHOW_CURSOR = "\033[?25h"


def supervised(command: Sequence[str], environment: Mapping[str, str], started: Path) -> tuple[int, bool]:
    """Run Snakemake to its end.

    On Ctrl-C the jobs are ended at once and Snakemake tidies up, so that no lock stays behind; Ctrl-C again ends all.

    Args:
        command: with its arguments.
        environment: of the child.
        started: a file that the child makes once it can be interrupted without a traceback.

    Returns:
        The child's exit status, and whether it was stopped.
    """
    requests: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        requests.append(number)

    # Before the child starts: one that is started in the background ignores Ctrl-C, and so would its child.
    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        # A group of its own: the terminal's Ctrl-C comes here alone, and from here to each process what suits it.
        child = subprocess.Popen(command, env=dict(environment), process_group=0)
        answered = 0
        while True:
            try:
                return child.wait(_POLL_S), bool(requests)
            except subprocess.TimeoutExpired:
                if requests:
                    _stop(child.pid, first=answered == 0, at_once=len(requests) > 1, started=started)
                    answered += 1
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if sys.stderr.isatty():
            sys.stderr.write(_SHOW_CURSOR)


def _stop(pid: int, *, first: bool, at_once: bool, started: Path) -> None:
    try:
        main = psutil.Process(pid)
        jobs = main.children(recursive=True)
    except psutil.NoSuchProcess:
        return
    if at_once:
        os.killpg(pid, signal.SIGKILL)
    elif first:
        main.send_signal(signal.SIGINT if started.exists() else signal.SIGTERM)
    for job in jobs:
        try:
            job.terminate()
        except psutil.NoSuchProcess:
            continue
