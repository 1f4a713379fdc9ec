"""Gland's share of each element, made where a material asks for it."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.meshing.fractions import tissue_fraction
from stages.engine.artefact import Array, Artefact
from stages.engine.contract import Inputs
from stages.engine.errors import UserError
from stages.methods import block_mesh

GLAND_SHARE = "gland_fraction"
_FAT, _GLAND, _SKIN = 1, 2, 3


def gland_share(inputs: Inputs) -> NDArray[np.float64]:
    """Volume share (E,) of gland in each element of `mesh`, by the labels of `segment`.

    Raises:
        UserError: `segment` was not given.
    """
    if not inputs.has("segment"):
        raise UserError("a material that tells gland from fat needs the input segment; give it with --in segment=path")
    segment = inputs.artefact("segment")
    labels = segment.volume("labels").to_breast(segment.laterality)
    return tissue_fraction(block_mesh(inputs.artefact("mesh")), labels, _GLAND, (_FAT, _GLAND, _SKIN))


def kept_gland_share(compress: Artefact) -> NDArray[np.float64] | None:
    """The shares that `compress` was made with, None where its material did not ask for them."""
    return compress.array(GLAND_SHARE, "1") if GLAND_SHARE in compress.names() else None


def gland_share_array(share: NDArray[np.float64] | None) -> dict[str, Array]:
    """The shares as an array of an artefact; nothing without them."""
    return {} if share is None else {GLAND_SHARE: Array(share, "1", "gland's share of each hexahedron")}
