"""What a solution between the plates says against itself, for the `trust` of `views.csv`."""

from dataclasses import dataclass

from stages.solution import SolutionRecord


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


def mechanical_doubts(
    solution: SolutionRecord | None, compress: SolutionRecord | None, limits: MechanicalLimits
) -> list[str]:
    """Facts that speak against a solution, in words.

    Args:
        solution: of the method, `compress` or `solve`; None: a method without mechanics.
        compress: of the view. Its drift counts for `solve` too: the outline draws back the silhouette of a breast
            that has tipped over, and not what lies within.
        limits: what is too much.
    """
    if solution is None:
        return []
    deep_mm, corners = solution.penetration_mm or 0.0, solution.folded_corners or 0
    share, drift_mm = solution.folded_share or 0.0, (compress.sideways_drift_mm if compress else None) or 0.0
    doubts = {
        f"skin or back {deep_mm:.1f} mm inside a plate": deep_mm > limits.penetration * solution.thickness_mm,
        f"{corners} folded corners in {share:.0%} of the elements": share > limits.folded,
        f"breast tipped sideways by {abs(drift_mm):.1f} mm": abs(drift_mm) > limits.drift * solution.thickness_mm,
        _lost(solution): solution.contact_lost,
    }
    return [text for text, holds in doubts.items() if holds]


def _lost(solution: SolutionRecord) -> str:
    lower, upper = solution.plate_forces_n
    plate = "lower" if lower < upper else "upper"
    return f"contact with the {plate} plate lost ({min(lower, upper):.1f} N, the other {max(lower, upper):.1f} N)"
