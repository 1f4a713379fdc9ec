"""What is usual of a woman's breast and of its picture in MR: ranges with where each comes from."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Range:
    """What a quantity usually is, and from where on it is not a breast's at all.

    Attributes:
        what: the quantity in words.
        unit: of all four limits; "1" for a share.
        low, high: usual; beyond them a result is doubted.
        least, most: beyond them the volume is refused.
        source: where the numbers come from.
    """

    what: str
    unit: str
    low: float = -np.inf
    high: float = np.inf
    least: float = -np.inf
    most: float = np.inf
    source: str = ""


VOLUME, SKIN, GLAND, ROUGH = "breast_volume", "skin_thickness", "gland_share", "rough_skin"
CONTRAST, DARK, CUT, HEIGHTS = "skin_contrast", "dark_inside", "cut_by_volume", "height_of_other_breast"
MUSCLE = "muscle_behind_back"

RANGES: Mapping[str, Range] = {
    VOLUME: Range(
        "volume of the breast",
        "ml",
        low=55.0,
        high=4777.0,
        least=15.0,
        most=10000.0,
        source="55 to 4777 ml in 400 women (PMC3076010); refused: chosen",
    ),
    SKIN: Range(
        "thickness of the skin as the volume shows it",
        "mm",
        low=0.5,
        high=5.2,
        source="1.44 mm, 0.87 to 2.34 (doi 10.1118/1.4793257), and two voxels of blur",
    ),
    GLAND: Range(
        "share of gland",
        "1",
        low=0.02,
        high=0.6,
        source="95 % of women below 0.45 of the whole breast (Yaffe et al., Med Phys 2009); the model leaves out fat "
        "in front of the chest",
    ),
    ROUGH: Range(
        "share of the skin that stands 2.5 mm off a smooth surface",
        "1",
        high=0.02,
        source="chosen: below 0.003 in real breasts",
    ),
    CONTRAST: Range(
        "share of the skin across which the signal falls by half",
        "1",
        low=0.85,
        least=0.5,
        source="chosen: above 0.95 in real breasts",
    ),
    DARK: Range(
        "share of the breast's inside that is as dark as air",
        "1",
        high=0.01,
        most=0.15,
        source="chosen: below 0.006 in real breasts; above 0.2 in subtractions of fatty ones",
    ),
    CUT: Range(
        "share of the breast's surface that lies on the end of the volume",
        "1",
        high=0.03,
        most=0.3,
        source="chosen: none where the whole breast is in view",
    ),
    HEIGHTS: Range(
        "height of the other breast over this one's",
        "1",
        low=0.5,
        high=2.0,
        source="chosen: breasts of one woman differ by less",
    ),
    MUSCLE: Range(
        "distance from the model's back to the pectoral muscle",
        "mm",
        source="10 to 55 mm in nine of ten labelled breasts; told, not judged",
    ),
}
"""By the name of the check."""

FIELD_OF_VIEW = Range(
    "length of the volume",
    "mm",
    low=40.0,
    high=700.0,
    least=40.0,
    most=700.0,
    source="a breast on the chest is larger, the bore of a scanner is 600 or 700 mm wide",
)
