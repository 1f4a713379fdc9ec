"""The table of the mutants: one row each as CSV, and counts by kind and layer for a reader."""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.mutants.judge import SAME_MM, WRONG_MM, Judged, broken_demands, flags_of
from tests.mutants.pipeline import Outcome

LAYERS = ("check", "stage", "trust", "marks", "nothing", "traceback", "hang")
COLUMNS = ("kind", "mutation", "base", "number", "harmless", "layer", "error_mm", "seconds", "note", "said")


def write_account(folder: Path, mutants: Sequence[Judged], bases: Mapping[str, Outcome]) -> str:
    """Write `mutants.csv` and `mutants.md`; returns the latter's text."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "mutants.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for m in mutants:
            said = " | ".join(m.verdict.said.splitlines())[:400]
            error = f"{m.verdict.error_mm:.2f}"
            row = (m.kind, m.name, m.base, m.number, int(m.harmless), m.verdict.layer, error, m.seconds, m.note, said)
            writer.writerow(row)
    text = summary(mutants, bases)
    (folder / "mutants.md").write_text(text, encoding="utf-8")
    return text


def summary(mutants: Sequence[Judged], bases: Mapping[str, Outcome]) -> str:
    """Counts by kind of mutation and by the layer that caught it, then what is not met."""
    lines = ["# Mutants", "", f"{len(mutants)} mutants of {len(bases)} cases. What each layer caught:", ""]
    head = ("kind", "mutants", *LAYERS[:4], "nothing, same", "nothing, 1-5 mm", "nothing, beyond", *LAYERS[5:])
    lines += [_line(head), _line(["---", *["---:"] * (len(head) - 1)])]
    for harmless in (False, True):
        chosen = [m for m in mutants if m.harmless == harmless]
        kinds = dict.fromkeys(m.kind for m in chosen)
        lines += [_counts(kind + " (harmless)" * harmless, [m for m in chosen if m.kind == kind]) for kind in kinds]
        lines.append(_counts(f"**all {'harmless' if harmless else 'harmful'}**", chosen))
    lines += ["", "Unmutated cases:", ""]
    for name, outcome in bases.items():
        lines.append(f"* {name}: {outcome.ended}; {'; '.join(flags_of(outcome)) or 'no flag'}")
    broken = broken_demands(mutants, bases.values())
    lines += ["", "Not met:" if broken else "All demands are met.", "", *(f"* {text}" for text in broken)]
    return "\n".join(lines) + "\n"


def _counts(label: str, mutants: Sequence[Judged]) -> str:
    by = Counter(m.verdict.layer for m in mutants)
    errors = [m.verdict.error_mm for m in mutants if m.verdict.silent]
    beyond = sum(error > WRONG_MM for error in errors)
    between = sum(SAME_MM < error <= WRONG_MM for error in errors)
    quiet = (len(errors) - beyond - between, between, beyond)
    return _line([label, len(mutants), *(by[x] for x in LAYERS[:4]), *quiet, *(by[x] for x in LAYERS[5:])])


def _line(cells: Sequence[object]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"
