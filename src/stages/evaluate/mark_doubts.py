"""Lesions marked far from where the other side's marks lead: another lesion, another frame, or a wrong result."""

from collections.abc import Sequence

from stages.evaluate.record import Row
from stages.methods import SHOWN_METHOD


def mark_doubts(in_mammograms: Sequence[Row], in_mr: Sequence[Row], limit_mm: float) -> list[str]:
    """What the marks of both sides say against each other, in words.

    It looks at lesions that bear one name on both sides, so it is no part of `trust`: that must not know the answer,
    which most users do not have.

    Args:
        in_mammograms, in_mr: rows of `table_5.csv` and `table_6.csv`; in MR only what several views determine counts.
        limit_mm: beyond this distance of marked from predicted place.
    """
    rows = [(row["view"], row) for row in in_mammograms] + [(row["views"], row) for row in in_mr if "+" in row["views"]]
    return [
        f"{place}: {row['name']} is marked {row['distance_mm']:.0f} mm from where the other side's mark leads: "
        "check that both mark one lesion"
        for place, row in rows
        if row["method"] == SHOWN_METHOD and row["distance_mm"] is not None and row["distance_mm"] > limit_mm
    ]
