"""Names of views."""

from typing import Literal, get_args

from mammoreg.imaging.mammogram_orientation import View

IMAGED: tuple[View, ...] = get_args(View)
"""Views that a mammogram shows."""
SECOND_VOLUME: Literal["3D"] = "3D"
"""The view of a case without mammograms: plates that a second volume, or `compression`, tells of."""
