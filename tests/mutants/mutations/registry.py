"""What a mutation is, and the list that the modules of this package make of theirs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from numpy.random import Generator

from tests.mutants.case_folder import CaseFolder, Effect

Change = Callable[[CaseFolder, Generator], Effect | None]


@dataclass(frozen=True)
class Mutation:
    """One way to change a case.

    Attributes:
        kind: what is changed, for the count by kind.
        name: how.
        change: does it.
        bases: unmutated cases that it is applied to.
        times: mutants of each, with seeds of their own.
        harmless: the files say the same as before.
        landmarks: predicted landmarks are judged beside lesions.
    """

    kind: str
    name: str
    change: Change
    bases: tuple[str, ...]
    times: int = 1
    harmless: bool = False
    landmarks: bool = False


class Mutations:
    """The mutations of one kind."""

    def __init__(self, kind: str, bases: Sequence[str]) -> None:
        self.kind, self.bases, self.found = kind, tuple(bases), list[Mutation]()

    def add(
        self,
        name: str,
        change: Change,
        *,
        bases: Sequence[str] = (),
        times: int = 1,
        harmless: bool = False,
        landmarks: bool = False,
    ) -> None:
        """Add one."""
        chosen = tuple(bases) or self.bases
        self.found.append(Mutation(self.kind, name, change, chosen, times, harmless, landmarks))
