"""Errors that a user can mend: each says what is wrong, where, and what to do."""

from collections.abc import Iterable
from dataclasses import dataclass

from stages.engine.outcome import BUG, CASES_FAILED, MISTAKE


@dataclass(frozen=True)
class Fault:
    """One thing wrong in what a user handed in.

    Attributes:
        where: file, row and key, as the user would look them up.
        what: what is wrong, with the offending value.
        remedy: what to do about it; empty where `what` says so already.
    """

    where: str
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.what}" + (f"; {self.remedy}" if self.remedy else "")


class UserError(Exception):
    """A mistake in what the user handed in; the message is meant to be read without a traceback.

    Attributes:
        outcome: exit status of the run that it ends.
    """

    outcome = MISTAKE


class CasesFailedError(UserError):
    """Some case failed; the others and the tables are there."""

    def __init__(self, message: str, *, by_bug: bool) -> None:
        super().__init__(message)
        self.outcome = BUG if by_bug else CASES_FAILED


class FaultsError(UserError):
    """Several faults, listed at once."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        count = len(self.faults)
        lines = [f"{count} fault{'s' if count != 1 else ''} found before the first job:"]
        super().__init__("\n".join(lines + [f"  {number}. {fault}" for number, fault in enumerate(self.faults, 1)]))


class ArtefactError(UserError):
    """An artefact cannot be read or written, or does not hold what was asked of it."""
