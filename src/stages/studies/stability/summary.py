"""What the stability study shows: rates, iterations, the trend with the mesh, and every failure by name."""

from collections.abc import Iterable, Sequence
from statistics import median
from typing import Any

from mammoreg.scenes.checks import FIRST_PENETRATION_MM, PENETRATION
from mammoreg.scenes.design import ORDINARY, WORST
from stages.formats.pages import Section, section_of

Row = dict[str, Any]

LEAST_RATE = 0.99
MOST_RATIO = 1.3
TREND_SHARE = 0.15
"""Largest change of force and of the breast's extent from the second finest to the finest mesh."""
FACTORS = ("material", "nu", "compression", "elements", "contrast", "shape", "friction")
_AGAIN = (
    "python -m stages run stability_batch --case cohort --row batch=0 --out again.h5 --settings "
    """'{"batches": 1, "only": ["%s"]}'"""
)


def with_mesh_trend(rows: list[Row]) -> list[Row]:
    """Rows with one more check: where bodies without a gland differ in the mesh alone, the finest two must agree."""
    rows = [dict(row) for row in rows]
    for group in _mesh_groups(rows):
        coarse, fine = group[-2:]
        change = max(abs(fine[name] / coarse[name] - 1.0) for name in ("force_n", "width_mm", "depth_mm"))
        check = {"name": "change from the next coarser mesh", "value": change, "limit": TREND_SHARE}
        fine["checks"] = [*fine["checks"], check]
        if change > TREND_SHARE:
            said = f"{check['name']} is {change:.3g}, above {TREND_SHARE:g}"
            fine["checks_passed"] = False
            fine["message"] = "; ".join(filter(None, [fine["message"], said]))
    return rows


def summary(rows: Sequence[Row]) -> tuple[list[str], list[Section]]:
    """What must be said first, and tables; the first sentence begins with "Not met" where the study has failed."""
    ran = [row for row in rows if row["converged"] is not None]
    solved = [row for row in ran if row["converged"]]
    wrong = [row for row in solved if not row["checks_passed"]]
    rate, ratio = len(solved) / max(len(ran), 1), _ratio(_pairs(rows))
    met = rate >= LEAST_RATE and not wrong and (ratio is None or ratio <= MOST_RATIO)
    first = [
        f"{'Met' if met else 'Not met'}: {len(solved)} of {len(ran)} scenarios that ran converged ({100 * rate:.1f} %, "
        f"asked {100 * LEAST_RATE:.0f} %); {len(wrong)} of these answers fail a check from outside (asked 0)"
        + (
            ""
            if ratio is None
            else f"; iterations at nu {WORST:g} are {ratio:.2f} times those at {ORDINARY:g} (asked {MOST_RATIO:g})"
        )
    ]
    if lost := [row["scenario"] for row in ran if not (row["converged"] and row["checks_passed"])]:
        first.append(f"Missed, each listed below: {', '.join(lost)}. One of them again: {_AGAIN % lost[0]}")
    first.append(_moved_limit(solved))
    if len(ran) < len(rows):
        first.append(f"{len(rows) - len(ran)} of {len(rows)} scenarios did not run; the last table says why.")
    return first, _sections(rows, ran, solved)


def _moved_limit(solved: Sequence[Row]) -> str:
    """What a reader has to know of a limit that was not set before the first runs."""
    deeper = [row["scenario"] for row in solved if row["penetration_mm"] > FIRST_PENETRATION_MM]
    return (
        f"The limit of the penetration was moved after the first runs, from {FIRST_PENETRATION_MM:g} mm to "
        f"{100 * PENETRATION:g} % of the gap; by the first limit {len(deeper)} of {len(solved)} answers would fail"
        + (f": {', '.join(deeper)}." if deeper else ".")
    )


def _sections(rows: Sequence[Row], ran: Sequence[Row], solved: Sequence[Row]) -> list[Section]:
    unsolved = [row for row in ran if not row["converged"] or not row["checks_passed"]]
    candidates = [
        section_of("Not converged, or failing a check", [_named(row) for row in unsolved]),
        section_of("Checks from outside over all converged answers", _check_rows(solved)),
        section_of("By level of each factor", [_level_row(ran, f, level) for f, level in _levels(ran)]),
        section_of("Newton iterations, pairs that differ in Poisson's ratio alone", _pair_rows(_pairs(rows))),
        section_of("The same body without a gland on finer and finer meshes", _trend_rows(rows)),
        section_of("Did not run", [_named(row) for row in rows if row["converged"] is None]),
    ]
    return [section for section in candidates if section.rows]


def _named(row: Row) -> Row:
    return {name: row[name] for name in ("scenario", *FACTORS, "message")}


def _check_rows(solved: Sequence[Row]) -> list[Row]:
    """Each check's largest share of its limit; det F, whose limit is 0, by its smallest value."""
    names = list(dict.fromkeys(check["name"] for row in solved for check in row["checks"]))
    return [
        _check_row(name, [(row, c) for row in solved for c in row["checks"] if c["name"] == name]) for name in names
    ]


def _check_row(name: str, found: Sequence[tuple[Row, Row]]) -> Row:
    def exceeds(one: tuple[Row, Row]) -> float:
        value, limit = one[1]["value"], one[1]["limit"]
        return float("inf") if value is None else value / limit if limit > 0.0 else value

    row, check = max(found, key=exceeds)
    number = "not a number" if check["value"] is None else f"{check['value']:.3g}"
    return {"check": name, "worst": number, "its limit": f"{check['limit']:.3g}", "scenario": row["scenario"]}


def _levels(ran: Sequence[Row]) -> list[tuple[str, Any]]:
    """All levels, numbers in their order."""
    found = []
    for factor in FACTORS:
        levels = dict.fromkeys(row[factor] for row in ran)
        found += [(factor, level) for level in sorted(levels, key=lambda v: (isinstance(v, str), v))]
    return found


def _level_row(ran: Sequence[Row], factor: str, level: Any) -> Row:
    here = [row for row in ran if row[factor] == level]
    solved = [row for row in here if row["converged"]]
    return {
        "factor": factor,
        "level": level,
        "ran": len(here),
        "converged": len(solved),
        "checks passed": sum(bool(row["checks_passed"]) for row in solved),
        "iterations, median": f"{_median(row['newton_iterations'] for row in solved):.0f}",
        "iterations, most": max((row["newton_iterations"] for row in solved), default=0),
        "solve, median s": f"{_median(row['wall_s'] for row in solved):.1f}",
    }


def _pairs(rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Converged scenarios at the ordinary and at the worst Poisson's ratio that are else alike."""
    worst = {_key(row, "nu"): row for row in rows if row["converged"] and row["nu"] == WORST}
    ordinary = [row for row in rows if row["converged"] and row["nu"] == ORDINARY]
    return [(row, worst[_key(row, "nu")]) for row in ordinary if _key(row, "nu") in worst]


def _ratio(pairs: Sequence[tuple[Row, Row]]) -> float | None:
    """All iterations at the worst over all at the ordinary Poisson's ratio."""
    if not pairs:
        return None
    return float(sum(b["newton_iterations"] for _, b in pairs) / sum(a["newton_iterations"] for a, _ in pairs))


def _pair_rows(pairs: Sequence[tuple[Row, Row]]) -> list[Row]:
    """Ratios over all pairs and by compression."""
    shares = sorted({row["compression"] for row, _ in pairs})
    groups = {f"{100 * share:.0f} %": [p for p in pairs if p[0]["compression"] == share] for share in shares}
    return [_pair_row(name, group) for name, group in ({"all": list(pairs)} | groups).items() if group]


def _pair_row(name: str, pairs: Sequence[tuple[Row, Row]]) -> Row:
    each = [b["newton_iterations"] / a["newton_iterations"] for a, b in pairs]
    return {
        "compression": name,
        "pairs": len(pairs),
        f"iterations at {ORDINARY:g}": sum(a["newton_iterations"] for a, _ in pairs),
        f"iterations at {WORST:g}": sum(b["newton_iterations"] for _, b in pairs),
        "ratio of the sums": f"{_ratio(pairs):.2f}",
        "median of the ratios": f"{median(each):.2f}",
        "largest ratio": f"{max(each):.2f}",
    }


def _mesh_groups(rows: Sequence[Row]) -> list[list[Row]]:
    """Converged scenarios without a gland that differ in the mesh alone, from the coarsest on."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["converged"] and row["contrast"] == 1:
            groups.setdefault(_key(row, "elements"), []).append(row)
    return [sorted(group, key=lambda row: row["elements"]) for group in groups.values() if len(group) > 1]


def _trend_rows(rows: Sequence[Row]) -> list[Row]:
    return [
        {
            **{name: row[name] for name in FACTORS},
            "force, N": f"{row['force_n']:.3f}",
            "width, mm": f"{row['width_mm']:.1f}",
            "depth, mm": f"{row['depth_mm']:.1f}",
        }
        for group in _mesh_groups(rows)
        for row in group
    ]


def _key(row: Row, left_out: str) -> tuple[Any, ...]:
    return tuple(row[factor] for factor in FACTORS if factor != left_out)


def _median(values: Iterable[float]) -> float:
    found = list(values)
    return float(median(found)) if found else 0.0
