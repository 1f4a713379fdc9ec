"""Values as an artefact keeps them, JSON, and as a person reads them: rounded numbers, lists of rows as tables."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

LONGEST = 100
_MOST_ROWS = 60


def json_value(value: Any) -> Any:
    """JSON types for NumPy scalars and arrays; a number that is not finite becomes null."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    return value


def value_lines(values: Mapping[str, Any]) -> Iterator[str]:
    """A line a value; a list of rows becomes a table below its name."""
    for name, value in values.items():
        if _is_table(value):
            yield f"  {name}, {len(value)} rows"
            yield from (f"    {line}" for line in table_lines(value))
        else:
            text = value if isinstance(value, str) else rounded(value)
            yield f"  {name} = {text if len(text) <= LONGEST else text[:LONGEST] + ' ...'}"


def table_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Rows under the names of their columns, aligned; numbers rounded, empty cells as `-`."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    shown = rows[:_MOST_ROWS]
    cells = [columns, *([_cell(row.get(column)) for column in columns] for row in shown)]
    widths = [max(len(line[n]) for line in cells) for n in range(len(columns))]
    numeric = [all(isinstance(row.get(c), int | float | None) for row in rows) for c in columns]
    lines = [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(line, widths, numeric, strict=True)
        ).rstrip()
        for line in cells
    ]
    return lines + ([f"and {len(rows) - len(shown)} more; export writes all"] if len(rows) > len(shown) else [])


def rounded(value: Any) -> str:
    """A JSON value with its numbers at four digits."""
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, float):
        text = f"{value:.0f}" if 1000.0 <= abs(value) < 1e9 else f"{value:.4g}"
        return "0" if text == "-0" else text
    if isinstance(value, list):
        return f"[{', '.join(map(rounded, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {rounded(item)}' for key, item in value.items())}}}"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value)


def _cell(value: Any) -> str:
    if value is None or value == "":
        return "-"
    return value if isinstance(value, str) else rounded(value)


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, dict) for row in value)
