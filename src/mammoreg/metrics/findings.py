"""Statements of the paper, judged by numbers measured here.

Numbers are looked up by texts such as "plate mean" or "updated max": a name, and what of its `Summary` is meant.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from mammoreg.metrics.summary import Summary

Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Claim:
    """A statement of the paper.

    Attributes:
        text: the statement.
        holds: whether numbers agree with it.
        shown: the numbers that decide, in words.
    """

    text: str
    holds: Callable[[Numbers], bool]
    shown: Callable[[Numbers], str]


@dataclass(frozen=True)
class Finding:
    """A statement that has been judged.

    Attributes:
        statement: of the paper.
        held: whether it holds here; None where it could not be judged.
        paper, here: the numbers that decide, in words.
    """

    statement: str
    held: bool | None
    paper: str
    here: str


def numbers_of(summaries: Mapping[str, Summary]) -> dict[str, float]:
    """Mean, SD and maximum of each summary to 0.1 mm, as the paper prints them, and its shares; not what is unknown."""
    found: dict[str, float] = {}
    for name, summary in summaries.items():
        values = {
            "mean": summary.mean_mm,
            "sd": summary.sd_mm,
            "max": summary.max_mm,
            "within": summary.within_5_mm_percent,
            "improvement": summary.improvement_percent,
            "n": summary.n,
        }
        found |= {f"{name} {what}": round(value, 1) for what, value in values.items() if value is not None}
    return found


def judged(claims: Sequence[Claim], paper: Numbers, here: Numbers) -> list[Finding]:
    """Each statement by the numbers here; where one of them is missing it is not judged."""
    findings = []
    for claim in claims:
        try:
            held, shown = claim.holds(here), claim.shown(here)
        except KeyError:
            held, shown = None, ""
        findings.append(Finding(claim.text, held, claim.shown(paper), shown))
    return findings


def lower(name: str, than: str, what: str) -> tuple[Callable[[Numbers], bool], Callable[[Numbers], str]]:
    """Whether a number of one variation is below that of another, as `holds` and `shown` of a claim."""
    return (
        lambda n: n[f"{name} {what}"] < n[f"{than} {what}"],
        lambda n: f"{n[f'{than} {what}']:.1f} to {n[f'{name} {what}']:.1f} mm",
    )
