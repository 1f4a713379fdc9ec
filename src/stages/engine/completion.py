"""What failed first, and whether a cohort is complete: the last thing that a run says."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from stages.engine.artefact import Artefact
from stages.engine.errors import CasesFailedError
from stages.engine.failures import Failure
from stages.engine.writing import write_bytes

_REMEDY = "Mend the data, or give the row a reason in the column exclude, and run again."
_BUG_REMEDY = "What was stopped by a bug is tried again after the code has changed, or once its artefact is deleted."


def first_failure(artefacts: Iterable[Artefact]) -> Failure | None:
    """The failure of the first artefact that did not end well, which a stage passes on; None if all did."""
    return next((artefact.failure for artefact in artefacts if artefact.failure), None)


def first_failures(artefacts: Iterable[Artefact]) -> list[tuple[str, Failure]]:
    """Each stage that failed first, with its case before it; what later stages carry on is not told again."""
    return list(dict.fromkeys((a.case, a.failure) for a in artefacts if a.failure))


def write_completion(artefacts: Sequence[Path], output: Path) -> None:
    """Write the file that says that no case failed.

    Args:
        artefacts: of all cases, in the order of the pipeline.
        output: the file.

    Raises:
        CasesFailedError: a case failed; each is named with its message.
    """
    opened = [Artefact(path) for path in artefacts]
    cases = sorted({artefact.case for artefact in opened})
    failures = first_failures(opened)
    if failures:
        count = len({case for case, _ in failures})
        lines = [f"  {case}{f' {failure.view}' if failure.view else ''}: {failure}" for case, failure in failures]
        head = f"{count} of {len(cases)} cases did not finish; the tables are written and name them:"
        bugs = any(failure.status == "bug" for _, failure in failures)
        raise CasesFailedError("\n".join([head, *lines, _REMEDY, *([_BUG_REMEDY] if bugs else [])]), by_bug=bugs)
    write_bytes(output, "".join(f"{case}\tok\n" for case in cases).encode())
