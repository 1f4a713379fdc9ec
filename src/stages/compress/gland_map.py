"""Gland's share of each element, made where a material asks for it."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.meshing.fractions import gland_fraction
from stages.engine.contract import Inputs
from stages.engine.errors import UserError
from stages.mesh.record import MeshRecord
from stages.segment.record import SegmentRecord


def gland_share(inputs: Inputs) -> NDArray[np.float64]:
    """Volume share (E,) of gland in each element of `mesh`, by the labels of `segment`.

    Raises:
        UserError: `segment` was not given.
    """
    if not inputs.has("segment"):
        raise UserError("a material that tells gland from fat needs the input segment; give it with --in segment=path")
    labels = SegmentRecord(inputs.artefact("segment")).labels
    return gland_fraction(MeshRecord(inputs.artefact("mesh")).block, labels)
