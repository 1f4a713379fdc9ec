"""Whether a cohort is complete: the last thing that a run says."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from stages.engine.artefact import Artefact, write_bytes
from stages.engine.errors import UserError


def first_failures(artefacts: Iterable[Artefact]) -> dict[tuple[str, str], Artefact]:
    """By case and message the first artefact that did not end well: later stages repeat its message."""
    failures: dict[tuple[str, str], Artefact] = {}
    for artefact in artefacts:
        if not artefact.ok:
            failures.setdefault((artefact.case, artefact.message.split(": ", 1)[-1]), artefact)
    return failures


def write_completion(artefacts: Sequence[Path], output: Path) -> None:
    """Write the file that says that no case failed.

    Args:
        artefacts: of all cases, in the order of the pipeline.
        output: the file.

    Raises:
        UserError: a case failed; each is named with its message.
    """
    opened = [Artefact(path) for path in artefacts]
    cases = sorted({artefact.case for artefact in opened})
    failures = first_failures(opened)
    if failures:
        count = len({case for case, _ in failures})
        lines = [f"  {case}{f' {a.view}' if a.view else ''}: {a.message}" for (case, _), a in failures.items()]
        head = f"{count} of {len(cases)} cases did not finish; the tables are written and name them:"
        remedy = "Mend the data, or give the row a reason in the column exclude, and run again."
        raise UserError("\n".join([head, *lines, remedy]))
    write_bytes(output, "".join(f"{case}\tok\n" for case in cases).encode())
