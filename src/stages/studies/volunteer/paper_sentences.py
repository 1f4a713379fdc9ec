"""What a volunteer's landmarks say about the paper's Tables II to IV: its statements, judged by the numbers here.

Numbers are looked up by texts such as "plate mean", "plate max", "none lateral mean", all in mm.
"""

from collections.abc import Mapping, Sequence

from mammoreg.metrics.findings import Claim, Finding, Numbers, lower
from mammoreg.metrics.paper import BEFORE, TABLE_2, TABLE_3, TABLE_4
from mammoreg.metrics.summary import LIMIT_MM, Summary

LINEAR = ("bakic", "lorenzen")
SKINS = ("attached", "sliding", "adherent")
ENCLOSING = ("sliding", "adherent")


def sentences(findings: Sequence[Finding]) -> list[str]:
    """One sentence each on what agrees, what does not and what could not be judged; none where it would be empty."""
    texts: dict[str, list[str]] = {"Agrees with the paper": [], "Does not agree": [], "Could not be judged": []}
    for finding in findings:
        if finding.held is None:
            texts["Could not be judged"].append(f"{finding.statement}, for want of a solution")
        else:
            head = "Agrees with the paper" if finding.held else "Does not agree"
            texts[head].append(f"{finding.statement} (paper: {finding.paper}; here: {finding.here})")
    return [f"{head}: {'; '.join(found)}." for head, found in texts.items() if found]


def _listed(n: Numbers, names: Sequence[str], what: str) -> str:
    return " and ".join(f"{n[f'{name} {what}']:.1f}" for name in names)


def _means(n: Numbers) -> list[float]:
    return [n[f"{model} mean"] for model in TABLE_2]


def _spread(n: Numbers) -> float:
    return round(max(_means(n)) - min(_means(n)), 1)


def _gain(n: Numbers, name: str) -> float:
    return round(n["plate mean"] - n[f"{name} mean"], 1)


def _others(n: Numbers) -> float:
    return max(n[f"{model} mean"] for model in TABLE_2 if model not in LINEAR)


MATERIAL_CLAIMS = (
    Claim(
        "the materials matter little: their means differ by no more than the landmarks of any one scatter",
        lambda n: _spread(n) <= min(n[f"{m} sd"] for m in TABLE_2),
        lambda n: f"{_spread(n):.1f} mm, SD {min(n[f'{m} sd'] for m in TABLE_2):.1f} mm and more",
    ),
    Claim(
        "the linear elastic materials, Bakic's and Lorenzen's, are the least accurate",
        lambda n: min(n[f"{m} mean"] for m in LINEAR) > _others(n),
        lambda n: f"{_listed(n, LINEAR, 'mean')} mm against {_others(n):.1f} mm and less",
    ),
    Claim(
        "every material leaves less than half of the landmarks' distance",
        lambda n: max(_means(n)) < 0.5 * n["before mean"],
        lambda n: f"{max(_means(n)):.1f} mm and less of {n['before mean']:.1f} mm",
    ),
    Claim(
        f"the mean of every material lies within {LIMIT_MM:.0f} mm",
        lambda n: max(_means(n)) <= LIMIT_MM,
        lambda n: f"{min(_means(n)):.1f} to {max(_means(n)):.1f} mm",
    ),
)

BOUNDARY_CLAIMS = (
    Claim("additional points lower the mean", *lower("additional_points", "plate", "mean")),
    Claim("additional points lower the maximum", *lower("additional_points", "plate", "max")),
    Claim("updated boundary conditions lower the mean", *lower("updated", "plate", "mean")),
    Claim(
        "updated boundary conditions lower the maximum further than additional points",
        *lower("updated", "additional_points", "max"),
    ),
    Claim(
        "updated boundary conditions gain at least half of what additional points gain in the mean",
        lambda n: _gain(n, "updated") > 0.0 and _gain(n, "updated") >= 0.5 * _gain(n, "additional_points"),
        lambda n: f"{_gain(n, 'updated'):.1f} of {_gain(n, 'additional_points'):.1f} mm",
    ),
    Claim(
        f"updated boundary conditions keep every landmark within {LIMIT_MM:.0f} mm",
        lambda n: n["updated max"] <= LIMIT_MM,
        lambda n: f"{n['updated max']:.1f} mm",
    ),
)

SKIN_CLAIMS = (
    Claim(
        "every skin lowers the mean lateral distance",
        lambda n: max(n[f"{skin} lateral mean"] for skin in SKINS) < n["none lateral mean"],
        lambda n: f"{n['none lateral mean']:.1f} to {_listed(n, SKINS, 'lateral mean')} mm",
    ),
    Claim(
        "every skin lowers the largest lateral distance",
        lambda n: max(n[f"{skin} lateral max"] for skin in SKINS) < n["none lateral max"],
        lambda n: f"{n['none lateral max']:.1f} to {_listed(n, SKINS, 'lateral max')} mm",
    ),
    Claim("attached skin lowers the mean distance", *lower("attached", "none", "mean")),
    Claim("attached skin lowers the maximum", *lower("attached", "none", "max")),
    Claim(
        "enclosing membranes raise the mean distance",
        lambda n: min(n[f"{skin} mean"] for skin in ENCLOSING) > n["none mean"],
        lambda n: f"{n['none mean']:.1f} to {_listed(n, ENCLOSING, 'mean')} mm",
    ),
)

CLAIMS = {"table_2": MATERIAL_CLAIMS, "table_3": BOUNDARY_CLAIMS, "table_4": SKIN_CLAIMS}
PAPER: Mapping[str, Mapping[str, Summary]] = {
    "table_2": {"before": BEFORE, **TABLE_2},
    "table_3": {"before": BEFORE, **TABLE_3},
    "table_4": {
        **{skin: both[0] for skin, both in TABLE_4.items()},
        **{f"{skin} lateral": both[1] for skin, both in TABLE_4.items()},
    },
}
"""The paper's summaries by the names of the claims' numbers."""
