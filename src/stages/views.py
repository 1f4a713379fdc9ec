"""Names of views, and their order."""

from typing import Literal

from mammoreg.imaging.views import VIEWS, View

IMAGED: tuple[View, ...] = VIEWS
"""Views that a mammogram shows."""
SECOND_VOLUME: Literal["3D"] = "3D"
"""The view of a case without mammograms: plates that a second volume, or `compression`, tells of."""


def view_order(view: str) -> int:
    """Place of a view in tables, reports and figures: a key to sort by, of a view that is not known the last."""
    return IMAGED.index(view) if view in IMAGED else len(IMAGED)
