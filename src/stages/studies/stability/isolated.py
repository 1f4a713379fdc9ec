"""A function in a process of its own, with a limit of time: what happens in it ends no other work."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import TypeVar

from mammoreg.errors import NotConvergedError

Result = TypeVar("Result")


def in_own_process(function: Callable[[], Result], limit_s: float) -> Result:
    """The function's result.

    Raises:
        NotConvergedError: it took longer than the limit, or its process died (out of memory, crash of a library).
        Exception: what the function raised, in words.
    """
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(function, sender))
    process.start()
    sender.close()
    try:
        if not receiver.poll(limit_s):
            raise NotConvergedError(f"stopped after the limit of {limit_s:g} s")
        result, error = receiver.recv()
    except EOFError:
        process.join()
        raise NotConvergedError(f"the process died (exit code {process.exitcode})") from None
    finally:
        process.kill()
        process.join()
        receiver.close()
    if error is not None:
        raise RuntimeError(error)
    return result  # type: ignore[no-any-return]


def _work(function: Callable[[], object], sender: Connection) -> None:
    """What the child does; a bug goes to the parent, which raises it."""
    try:
        sender.send((function(), None))
    except Exception as error:
        sender.send((None, f"{type(error).__name__}: {error}"))
