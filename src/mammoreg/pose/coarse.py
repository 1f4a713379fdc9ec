"""The coarse compression with which a pose is sought, as a function of the view."""

from collections.abc import Callable
from dataclasses import replace

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import closing_plates, place_breast
from mammoreg.errors import DataError, NotConvergedError
from mammoreg.fem.plates.closing import COARSE, ClosingOptions
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.estimate import Compressed

CAREFUL = ClosingOptions(steps=16, tolerance_mm=0.2)
"""Where the coarse options do not converge."""


def coarse_compression(
    mesh: BlockMesh, mechanics: BreastMechanics, mu_kpa: float, *, plates_known: bool
) -> Callable[[ViewGeometry], Compressed | None]:
    """A function that compresses the breast at a view's angle, edge and thickness; None where it does not converge.

    Args:
        mesh: undeformed, breast frame.
        mechanics: settings; all tissue is homogeneous and without skin here.
        mu_kpa: shear modulus.
        plates_known: the plates stand at the view's height, which a second volume shows.
    """
    alike = replace(mechanics, material="homogeneous", gland_contrast=1.0, skin="none")

    def compress(view: ViewGeometry) -> Compressed | None:
        breast = place_breast(mesh, view.angle_deg, alike, mu_kpa)
        lower_mm = view.height_mm if plates_known else None
        for options in (COARSE, CAREFUL):
            try:
                closed = closing_plates(breast, view.edge_p_mm, alike, options, lower_mm).close(view.thickness_mm)
            except (DataError, NotConvergedError):  # also plates that end in front of the breast
                continue
            return Compressed(closed.deformed, closed.height_mm)
        return None

    return compress
