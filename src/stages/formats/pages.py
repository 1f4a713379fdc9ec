"""A table as CSV, as readable text (Markdown) and as a page (HTML)."""

import csv
import html
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stages.formats.table import Row, Table

_STYLE = (
    "body{font-family:sans-serif;margin:2em;max-width:80em}table{border-collapse:collapse;margin:1em 0}"
    "td,th{padding:.2em .6em;border-bottom:1px solid #ccc;text-align:left}td.n{text-align:right}"
    ".first{color:#a00}"
)


@dataclass(frozen=True)
class Section:
    """A heading with paragraphs and a table of texts under it."""

    heading: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    paragraphs: Sequence[str] = ()


def cells(table: Table, rows: Iterable[Row]) -> list[list[str]]:
    """A table's cells as texts with fixed decimals; what is missing is empty."""
    return [[_text(row.get(column), table.numbers.get(column)) for column in table.columns] for row in rows]


def section_of(heading: str, rows: Sequence[Mapping[str, Any]]) -> Section:
    """A section of rows that share their columns."""
    columns = list(rows[0]) if rows else []
    return Section(heading, columns, [[_text(row[c], None) for c in columns] for row in rows])


def as_csv(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> bytes:
    """Comma-separated values with a header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue().encode()


def as_markdown(title: str, first: Sequence[str], sections: Sequence[Section]) -> bytes:
    """Readable text: what must be said first, then the sections with aligned columns."""
    lines = [f"# {title}", "", *(f"**{text}**\n" for text in first)]
    for section in sections:
        lines += [f"## {section.heading}", "", *(f"{text}\n" for text in section.paragraphs), *_aligned(section), ""]
    return "\n".join(lines).encode()


def as_html(title: str, first: Sequence[str], sections: Sequence[Section]) -> bytes:
    """A page that opens from disk."""
    head = f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>"
    parts = [head, f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>"]
    parts += [f"<p class=first>{html.escape(text)}</p>" for text in first]
    for section in sections:
        paragraphs = "".join(f"<p>{html.escape(text)}</p>" for text in section.paragraphs)
        parts.append(f"<h2>{html.escape(section.heading)}</h2>{paragraphs}{html_table(section)}")
    return "\n".join([*parts, "</html>", ""]).encode()


def html_table(section: Section) -> str:
    """The table alone; numbers stand at the right."""
    header = "".join(f"<th>{html.escape(column)}</th>" for column in section.columns)
    body = [
        "".join(f"<td{' class=n' if is_number(c) else ''}>{html.escape(c)}</td>" for c in row) for row in section.rows
    ]
    return f"<table><tr>{header}</tr>" + "".join(f"\n<tr>{row}</tr>" for row in body) + "</table>"


def _aligned(section: Section) -> list[str]:
    grid = [list(section.columns), *([c.replace("|", "/") for c in row] for row in section.rows)]
    widths = [max(3, *(len(line[i]) for line in grid)) for i in range(len(section.columns))]
    lines = ["| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |" for line in grid]
    return [lines[0], "|" + "|".join("-" * (w + 2) for w in widths) + "|", *lines[1:]]


def _text(value: Any, decimals: int | None) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if decimals is None:
        return str(value)
    text = f"{value:.{decimals}f}"
    # A rounded -0.00 would differ from 0.00 for nothing.
    return text.lstrip("-") if float(text) == 0 else text


def is_number(text: str) -> bool:
    """Whether a cell is a number, which stands at the right."""
    try:
        float(text)
    except ValueError:
        return False
    return True
