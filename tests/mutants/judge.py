"""What a mutant's outcome is worth, held against the unmutated case's. The limits are those of the demand."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tests.mutants.case_folder import Effect
from tests.mutants.pipeline import Outcome

SAME_MM, WRONG_MM = 1.0, 5.0
UNFLAGGED_SHARE, ALARM_SHARE = 0.02, 0.05

# What sound views carry too, and what therefore neither catches a mutant nor refuses a good file here.
USUAL = ("angle not determined by the image", r"force \d+ N outside 49-186 N")
UNSEEN = "outside the imaged part"

Layer = Literal["check", "stage", "trust", "marks", "nothing", "traceback", "hang"]


@dataclass(frozen=True)
class Verdict:
    """A mutant's end.

    Attributes:
        layer: what caught it; `marks` where only the marks of both sides, which few users have, contradict each other;
            `nothing` where an answer stands without a new flag.
        error_mm: largest distance of its answers from the unmutated ones; nan without answers, inf for a lost one.
        said: the fault, the failure or the new flags.
    """

    layer: Layer
    error_mm: float
    said: str = ""

    @property
    def broken(self) -> bool:
        return self.layer in ("traceback", "hang")

    @property
    def silent(self) -> bool:
        """Whether an answer stands with nothing said against it."""
        return self.layer == "nothing"


def judge(outcome: Outcome, base: Outcome, effect: Effect, landmarks: bool = False) -> Verdict:
    """The verdict on one mutant.

    Args:
        outcome, base: of the mutant and of its unmutated case.
        effect: what the mutation did to the frames of the answer.
        landmarks: whether landmarks count beside lesions.
    """
    error_mm = _error_mm(outcome, base, effect, landmarks)
    if outcome.ended in ("traceback", "bug"):
        return Verdict("traceback", error_mm, outcome.message)
    if outcome.ended == "hang":
        return Verdict("hang", error_mm, outcome.message)
    if outcome.ended in ("check", "failed"):
        return Verdict("check" if outcome.ended == "check" else "stage", error_mm, outcome.message)
    old = {_kind(flag) for flag in flags_of(base, landmarks)}
    new = [flag for flag in flags_of(outcome, landmarks) if _kind(flag) not in old]
    if not new and outcome.marks_differ and not base.marks_differ:
        return Verdict("marks", error_mm, "; ".join(outcome.marks_differ))
    return Verdict("trust" if new else "nothing", error_mm, "; ".join(new))


def flags_of(outcome: Outcome, landmarks: bool = False) -> list[str]:
    """Flags that tell a doubtful answer from a sound one: of views, of lesions, and of landmarks where they count."""
    counted = [text for key, text in outcome.flags.items() if landmarks or " lesion" in key or " " not in key]
    texts = [flag.strip() for text in counted for flag in text.split(";") if flag.strip()]
    usual = re.compile("|".join(USUAL))
    return [text for text in dict.fromkeys(texts) if not usual.search(text) and UNSEEN not in text]


def _kind(flag: str) -> str:
    """A flag without its numbers."""
    return re.sub(r"[-\d.]+", "#", flag)


def _error_mm(outcome: Outcome, base: Outcome, effect: Effect, landmarks: bool) -> float:
    if outcome.ended not in ("ok", "failed"):
        return float("nan")
    errors = [
        _mark_error(outcome, base, effect, place, name)
        for place, marks in base.marks.items()
        for name in marks
        if name.startswith("lesion") or landmarks
    ]
    known = [error for error in errors if error is not None]
    return max(known) if known else float("nan")


def _mark_error(outcome: Outcome, base: Outcome, effect: Effect, place: str, name: str) -> float | None:
    """Distance of one answer from the unmutated one, mm; inf where it is lost without a word, None where with one."""
    there, here = np.array(base.marks[place][name]), outcome.marks.get(place, {}).get(name)
    if here is None:
        said = outcome.ended == "failed" or f"{place} {name}" in outcome.flags
        unseen = UNSEEN in outcome.flags.get(f"{place} {name}", "")
        return None if said and not unseen else float("inf")
    if place == "MR":
        return float(np.linalg.norm(_back(effect.world, here) - there))
    return float(np.linalg.norm(_back(effect.pixels.get(place, np.eye(2, 3)), here) - there)) * base.scale_mm[place]


def _back(to_mutant: np.ndarray, place: list[float]) -> np.ndarray:
    """Where the unmutated case has a place of the mutant's."""
    return np.asarray(np.linalg.solve(to_mutant[:, :-1], np.array(place) - to_mutant[:, -1]))


@dataclass(frozen=True)
class Judged:
    """A mutant with its verdict.

    Attributes:
        harmless: whether its files say the same as the unmutated ones.
    """

    kind: str
    name: str
    base: str
    number: int
    harmless: bool
    verdict: Verdict
    note: str = ""
    seconds: float = 0.0


def broken_demands(mutants: Sequence[Judged], unmutated: Iterable[Outcome] = ()) -> list[str]:
    """Demands that these mutants do not meet, in words; none is the aim."""
    harmful = [m for m in mutants if not m.harmless]
    silent = [m for m in mutants if m.verdict.silent]
    between = [m for m in silent if SAME_MM < m.verdict.error_mm <= WRONG_MM]
    beyond = [m for m in silent if m.verdict.error_mm > WRONG_MM]
    broken = [m for m in mutants if m.verdict.broken]
    alarms = [m for m in mutants if m.harmless and not m.verdict.silent]
    good = list(unmutated)
    flagged = [o for o in good if o.ended != "ok" or flags_of(o)]
    sound = len(good) + len(mutants) - len(harmful)
    found = [f"{m.verdict.layer}: {_named(m)}" for m in broken]
    found += [f"{m.verdict.error_mm:.1f} mm off, nothing said: {_named(m)}" for m in beyond]
    if len(between) > UNFLAGGED_SHARE * len(mutants):
        listed = ", ".join(f"{_named(m)} {m.verdict.error_mm:.1f} mm" for m in between)
        found.append(f"{len(between)} of {len(mutants)} are off by 1 to 5 mm, nothing said: {listed}")
    if len(alarms) + len(flagged) > ALARM_SHARE * sound:
        listed = ", ".join(f"{_named(m)} ({m.verdict.said[:200]})" for m in alarms)
        found.append(f"{len(alarms) + len(flagged)} of {sound} sound inputs are flagged or refused: {listed}")
    return found


def _named(mutant: Judged) -> str:
    return f"{mutant.base}, {mutant.kind}: {mutant.name} ({mutant.note or mutant.number})"
