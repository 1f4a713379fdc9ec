"""Tables of text as editors and spreadsheets write them."""

import csv
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_OTHER_SEPARATORS = (";", ",")


class TableError(ValueError):
    """A file that cannot be read as a table; the message is the reason."""


@dataclass(frozen=True)
class Table:
    """A table's cells, without space around them, empty rows and empty columns that have no name.

    Attributes:
        header: names of the columns; one without a name is the empty text.
        rows: number of the row in the file, from 1 for the header, and its cells.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]


def read_table(path: Path, columns: Collection[str]) -> Table:
    """Read a table whose columns tabs separate, or semicolons or commas where its header shows that.

    Args:
        path: text in UTF-8 or, with a byte order mark, UTF-16.
        columns: names that its header may have.

    Raises:
        TableError: the file cannot be read.
    """
    text = _text(path)
    separator = _separator(text.split("\n", 1)[0], columns)
    try:
        lines = [[cell.strip() for cell in line] for line in csv.reader(text.splitlines(), delimiter=separator)]
    except csv.Error as error:
        raise TableError(str(error)) from error
    filled = [(number, line) for number, line in enumerate(lines[1:], start=2) if any(line)]
    header = lines[0] if lines else []
    width = max([len(header), *(len(line) for _, line in filled)])
    kept = [
        column
        for column in range(width)
        if (column < len(header) and header[column]) or any(line[column] for _, line in filled if column < len(line))
    ]
    rows = tuple((number, _chosen(line, kept)) for number, line in filled)
    return Table(_chosen(header, [column for column in kept if column < len(header)]), rows)


def _chosen(line: list[str], columns: list[int]) -> tuple[str, ...]:
    return tuple(line[column] for column in columns if column < len(line))


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
        return content.decode("utf-16" if content.startswith(_UTF16) else "utf-8-sig")
    except OSError as error:
        raise TableError(error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise TableError("it is no text in UTF-8") from error


def _separator(header: str, columns: Collection[str]) -> str:
    """What separates columns: a tab, unless another separator alone makes known names of the header."""
    if "\t" in header:
        return "\t"

    def known(separator: str) -> int:
        return sum(name.strip().strip('"') in columns for name in header.split(separator))

    best = max(_OTHER_SEPARATORS, key=known)
    return best if known(best) > 1 else "\t"
