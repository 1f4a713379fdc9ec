"""The plates of a closing as they stand when a breast has come to rest between them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.soft import SoftMemory
from mammoreg.contact.surface import ContactSurface
from mammoreg.fem.parts.standing_plates import StandingPlates
from mammoreg.fem.plates.closing import Closing


def standing_plates(
    closing: Closing, faces: NDArray[np.integer], gap_mm: float, height_mm: float, memory: SoftMemory
) -> StandingPlates:
    """The plates at a gap with the contact of a breast at rest, for faces of the body.

    Args:
        closing: the breast and its plates.
        faces: of the body (F, 4), in the order of the closing's own; these may be of a membrane over them.
        gap_mm: between the plates' faces.
        height_mm: by which both plates are raised.
        memory: what the contact points of the closing's faces remember.
    """
    surface = ContactSurface(closing.model.points, faces, closing.options.rule)
    contact = replace(closing.contact.stiffened(closing.options.stiffest), surface=surface)
    return StandingPlates(contact, closing.plates(gap_mm), height_mm, memory)
