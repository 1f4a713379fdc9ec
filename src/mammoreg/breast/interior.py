"""Interior of a breast under the surface that its outline has given (paper, section II-C, updated)."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Points
from mammoreg.breast.placed import PlacedBreast
from mammoreg.contact.soft import SoftMemory
from mammoreg.fem.parts.standing_plates import StandingPlates
from mammoreg.fem.plates.closing import Closing
from mammoreg.fem.plates.standing import standing_plates
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.solve import PrescribedOptions, PrescribedResult, solve_prescribed
from mammoreg.meshing.block import BlockMesh


def plates_around(
    mesh: BlockMesh, breast: PlacedBreast, closing: Closing, gap_mm: float, height_mm: float, memory: SoftMemory
) -> StandingPlates:
    """The plates as a surface was estimated between them, on the faces of skin and back.

    Args:
        mesh: undeformed, breast frame.
        breast: as it was before the plates closed.
        closing: the plates.
        gap_mm: between their faces.
        height_mm: by which both are raised.
        memory: what contact points remember of the breast at rest there.
    """
    faces = np.concatenate([mesh.skin_quads(), breast.back_quads])
    return standing_plates(closing, faces, gap_mm, height_mm, memory)


def solve_interior(
    breast: PlacedBreast,
    plates: StandingPlates,
    nodes: NDArray[np.int64],
    surface: Points,
    start: Points,
    pressure: Floats,
    newton: NewtonOptions | None = None,
) -> PrescribedResult:
    """Solve the interior of a breast whose surface is prescribed; back and plates act on the rest of it.

    Args:
        breast: as it was before the plates closed.
        plates: between which it lies.
        nodes: numbers (B,) of the prescribed nodes.
        surface: their places (B, 3), in the frame of the breast, mm.
        start: all nodes (N, 3) as the surface was estimated, in that frame.
        pressure: element pressures (E,) there, kPa.
        newton: when the interior is in equilibrium.

    Raises:
        NotConvergedError: with the reason.
    """
    return solve_prescribed(
        breast.model,
        nodes,
        surface,
        breast.back,
        start=start,
        pressure=pressure,
        parts=(*breast.loads, plates.beside(nodes)),
        options=PrescribedOptions(newton=newton if newton is not None else NewtonOptions()),
    )
