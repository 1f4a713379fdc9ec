"""Lesions marked far from where the other side's marks lead: another lesion, another frame, or a wrong result."""

from collections.abc import Sequence

from stages.evaluate.record import Row


def mark_doubts(
    view: str, method: str, in_mammograms: Sequence[Row], in_mr: Sequence[Row], limit_mm: float
) -> list[str]:
    """What a view's marks say against a method's result, or its result against the marks, in words.

    It looks at lesions that bear one name on both sides; predictions are made without it.

    Args:
        view, method: of the result.
        in_mammograms, in_mr: rows of `table_5.csv` and `table_6.csv`; in MR only what several views determine counts.
        limit_mm: beyond this distance of marked from predicted place.
    """
    rows = [row for row in in_mammograms if row["view"] == view]
    rows += [row for row in in_mr if "+" in row["views"] and view in row["views"].split("+")]
    far: dict[str, float] = {}
    for row in rows:
        distance_mm = row["distance_mm"]
        if row["method"] == method and distance_mm is not None and distance_mm > limit_mm:
            far[row["name"]] = max(distance_mm, far.get(row["name"], 0.0))
    return [
        f"{name} is marked {mm:.0f} mm from where the other side's mark leads: check that both mark one lesion"
        for name, mm in far.items()
    ]
