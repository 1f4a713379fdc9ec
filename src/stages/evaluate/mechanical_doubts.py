"""What a solution between the plates says against itself, for the `trust` of `views.csv`."""

from dataclasses import dataclass

from stages.engine.artefact import Artefact


@dataclass(frozen=True)
class MechanicalLimits:
    """Beyond these a breast between plates is doubted; each is wider than what sound compressions show.

    Attributes:
        penetration: of skin or back into a plate, as a share of the thickness.
        folded: elements with a folded corner, as a share of all.
        drift: of the breast sideways over its back, as a share of the thickness.
    """

    penetration: float
    folded: float
    drift: float


def mechanical_doubts(solution: Artefact | None, compress: Artefact | None, limits: MechanicalLimits) -> list[str]:
    """Facts that speak against a solution, in words.

    Args:
        solution: of the method, `compress` or `solve`; None: a method without mechanics.
        compress: of the view. Its drift counts for `solve` too: the outline draws back the silhouette of a breast
            that has tipped over, and not what lies within.
        limits: what is too much.
    """
    if solution is None:
        return []
    thickness_mm = _number(solution, "thickness_mm")
    deep_mm, corners = _number(solution, "penetration_mm"), int(_number(solution, "folded_corners"))
    share, drift_mm = _number(solution, "folded_share"), _number(compress, "sideways_drift_mm")
    doubts = {
        f"skin or back {deep_mm:.1f} mm inside a plate": deep_mm > limits.penetration * thickness_mm,
        f"{corners} folded corners in {share:.0%} of the elements": share > limits.folded,
        f"breast tipped sideways by {abs(drift_mm):.1f} mm": abs(drift_mm) > limits.drift * thickness_mm,
        _lost(solution): "contact_lost" in solution.value_names() and bool(solution.value("contact_lost")),
    }
    return [text for text, holds in doubts.items() if holds]


def _lost(solution: Artefact) -> str:
    lower, upper = (_number(solution, f"force_{plate}_n") for plate in ("lower", "upper"))
    plate = "lower" if lower < upper else "upper"
    return f"contact with the {plate} plate lost ({min(lower, upper):.1f} N, the other {max(lower, upper):.1f} N)"


def _number(artefact: Artefact | None, name: str) -> float:
    """A value, 0 where the artefact does not hold it."""
    return float(artefact.value(name)) if artefact is not None and name in artefact.value_names() else 0.0
