"""Codes of a label map's tissues, in every volume of labels that this package reads or makes."""

from enum import IntEnum


class Label(IntEnum):
    """What a voxel of the MR volume shows."""

    BACKGROUND = 0
    FAT = 1
    GLAND = 2
    SKIN = 3
    MUSCLE = 4
    """Muscle and chest wall."""


BREAST = (Label.FAT, Label.GLAND, Label.SKIN)
"""Tissues of the breast itself."""
