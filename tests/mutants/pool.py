"""Mutants side by side, each in a process of its own: a crash or a hang is that mutant's end and no other's."""

import multiprocessing
import os
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import TypeVar

Job = TypeVar("Job")
_FORK = multiprocessing.get_context("fork")


@dataclass
class _Running:
    process: BaseProcess
    number: int
    until: float


def run_all(
    jobs: Sequence[Job], work: Callable[[Job], None], processes: int, timeout_s: float
) -> Iterator[tuple[int, str]]:
    """Run the jobs, at most so many at a time.

    Args:
        jobs: what to do.
        work: does one; it leaves its result in a file.
        processes: at the same time.
        timeout_s: a job that takes longer is ended.

    Yields:
        Number of a job and how its process ended: done, hang or crash.
    """
    waiting, running = list(enumerate(jobs))[::-1], list[_Running]()
    while waiting or running:
        while waiting and len(running) < processes:
            number, job = waiting.pop()
            process = _FORK.Process(target=_quietly, args=(work, job))
            process.start()
            running.append(_Running(process, number, time.monotonic() + timeout_s))
        time.sleep(0.02)
        for one in list(running):
            if one.process.is_alive() and time.monotonic() < one.until:
                continue
            running.remove(one)
            yield one.number, _ended(one)


def _ended(one: _Running) -> str:
    if one.process.is_alive():
        one.process.kill()
        one.process.join()
        return "hang"
    one.process.join()
    return "done" if one.process.exitcode == 0 else "crash"


def _quietly(work: Callable[[Job], None], job: Job) -> None:
    """Without what the stages print, and with warnings that warn, as a user's run has them."""
    warnings.resetwarnings()
    warnings.simplefilter("ignore")
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    work(job)
