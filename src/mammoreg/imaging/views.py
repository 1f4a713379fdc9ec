"""The views of mammography: their names, their angles, and what lies at the top of their images."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mammoreg.errors import DataError

View = Literal["CC", "MLO", "ML", "LM", "LMO", "XCCL", "XCCM", "FB"]
"""ACR names: from the source's side to the detector's, exaggerated to lateral or medial, from below."""
VIEWS: tuple[View, ...] = get_args(View)


@dataclass(frozen=True)
class Projection:
    """How a view is taken.

    Attributes:
        name: in words.
        angle_deg: usual projection angle a, where a header gives none; the source lies along (-s sin a, 0, cos a) in
            LPS from the breast, s = +1 for a left and -1 for a right one.
        lowest_deg, highest_deg: angles that the view's name admits.
        shows_pectoral: whether the pectoral muscle may lie in the image's posterior superior corner.
    """

    name: str
    angle_deg: float
    lowest_deg: float
    highest_deg: float
    shows_pectoral: bool = False

    @property
    def rows_towards(self) -> frozenset[str]:
        """What canonical rows run towards: F or H where the view stands nearer to upright, M (medial), T (lateral)."""
        # Rows of the canonical image follow the plate frame's first axis: (cos a, 0, -sin a), medial first.
        medial, inferior = np.cos(np.deg2rad(self.angle_deg)), np.sin(np.deg2rad(self.angle_deg))
        letters = {("M" if medial > 0 else "T"): abs(medial), ("F" if inferior > 0 else "H"): abs(inferior)}
        return frozenset(letter for letter, share in letters.items() if share > 0.5)

    @property
    def upright(self) -> bool:
        """Whether rows run up or down the body: an image is then hung with superior on top, else with lateral."""
        return bool(self.rows_towards & {"F", "H"})

    @property
    def hung_as_canonical(self) -> bool:
        """Whether the canonical image's first row is the one that is hung on top."""
        return "F" in self.rows_towards if self.upright else "M" in self.rows_towards


PROJECTIONS: Mapping[View, Projection] = {
    "CC": Projection("cranio-caudal", 0.0, -30.0, 30.0),
    "MLO": Projection("medio-lateral oblique", 45.0, 15.0, 90.0, shows_pectoral=True),
    "ML": Projection("medio-lateral", 90.0, 60.0, 120.0, shows_pectoral=True),
    "LM": Projection("latero-medial", -90.0, -120.0, -60.0, shows_pectoral=True),
    "LMO": Projection("latero-medial oblique", -135.0, -165.0, -105.0, shows_pectoral=True),
    "XCCL": Projection("cranio-caudal exaggerated laterally", 0.0, -30.0, 30.0),
    "XCCM": Projection("cranio-caudal exaggerated medially", 0.0, -30.0, 30.0),
    "FB": Projection("caudo-cranial (from below)", 180.0, 150.0, 210.0),
}


def view_named(name: str | None) -> View:
    """The view of a name.

    Raises:
        DataError: there is none.
    """
    for view in VIEWS:
        if view == name:
            return view
    raise DataError(f"view {name!r} is not known; it is one of {', '.join(VIEWS)}")


def projection_of(view: str) -> Projection:
    """How a view is taken; a second volume, which is no view, shows the breast pressed as in CC."""
    return next((projection for name, projection in PROJECTIONS.items() if name == view), PROJECTIONS["CC"])
