"""A table: its columns, their decimals, and where each case's rows lie."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stages.engine.artefact import Artefact

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Table:
    """One table, written as `<name>.csv`, `.md` and `.html`.

    Attributes:
        title: for readers.
        stage, value: where each case's rows lie.
        keys: columns that say what a row is about, `case` apart.
        numbers: columns of numbers with their decimals.
        texts: further columns, behind the numbers.
    """

    name: str
    title: str
    stage: str
    value: str
    keys: tuple[str, ...]
    numbers: Mapping[str, int]
    texts: tuple[str, ...] = ()
    order: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns in the order of the file."""
        return self.order or ("case", *self.keys, *self.numbers, *self.texts)

    def rows(self, artefacts: Sequence[Artefact]) -> list[Row]:
        """The rows of all cases, in their order."""
        return [
            {"case": artefact.case, **row}
            for artefact in artefacts
            if artefact.stage == self.stage and self.value in artefact.value_names()
            for row in artefact.value(self.value)
        ]
