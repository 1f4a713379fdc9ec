"""Where the search for a pose begins."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mammoreg.arrays import Points
from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.estimate import Compressed
from mammoreg.pose.outlined import OutlinedView
from mammoreg.pose.scaling import fit_scaling
from mammoreg.pose.thickness import ThicknessEstimate, estimate_thickness

EDGE_QUANTILE = 0.25  # chosen: a plate's edge reaches in front of most, not all, of the breast's back


@dataclass(frozen=True)
class Start:
    """Geometry of a view before its angle is sought, and the thickness that was estimated, None where it is known."""

    view: ViewGeometry
    thickness: ThicknessEstimate | None = None


def start_view(seen: OutlinedView, mesh: BlockMesh, compress: Callable[[ViewGeometry], Compressed | None]) -> Start:
    """Place a view by the volume-preserving scaling at the header's angle, and estimate its thickness where needed.

    Raises:
        DataError: the mammogram's thickness is no compression of this breast, or cannot be estimated.
    """
    if seen.placed:
        return Start(seen.geometry)
    turned = breast_to_plate(mesh.points, seen.geometry.angle_deg)
    view = replace(
        seen.geometry,
        edge_p_mm=float(np.quantile(turned[mesh.back_nodes(), 1], EDGE_QUANTILE)),
        middle_mm=float(turned[:, 0].mean()),
    )
    found = None
    front = turned[turned[:, 1] < view.edge_p_mm, 2]
    height = float(np.ptp(front if len(front) else turned[:, 2]))
    if not np.isfinite(view.thickness_mm):
        facets = skin_facets(mesh.skin_quads(), len(mesh.points), 2)
        found = estimate_thickness(view, seen.outline, compress, facets, height)
        if found is None:
            raise DataError("the compressed thickness is unknown and cannot be estimated; give thickness_mm")
        view = replace(view, thickness_mm=found.thickness_mm)
    if view.thickness_mm >= height:
        raise DataError(
            f"the compressed thickness of {view.thickness_mm:.1f} mm is not below the uncompressed breast's "
            f"{height:.1f} mm; correct thickness_mm in the views table (or the header), or check the MR volume's side"
        )
    fitted = fit_scaling(mesh.points, mesh.skin_quads().astype(np.intp), view, seen.outline).alignment.view
    _refuse_runaway(turned, fitted, height)
    return Start(fitted, found)


def _refuse_runaway(turned: Points, fitted: ViewGeometry, height: float) -> None:
    """Refuse an edge that leaves less between the plates than these are apart, and not half of the breast's height.

    A breast scaled to too small a thickness is far larger than the one in the image; only its tip fits the outline
    then, and the edge moves through it.

    Raises:
        DataError: with the remedy.
    """
    front = turned[turned[:, 1] < fitted.edge_p_mm, 2]
    left = float(np.ptp(front)) if len(front) else 0.0
    if left < min(fitted.thickness_mm, 0.5 * height):
        raise DataError(
            f"the compressed thickness of {fitted.thickness_mm:.1f} mm is too small for a breast of {height:.1f} mm: "
            "so flat and volume-preserving it would be far larger than the mammogram shows it; correct thickness_mm "
            "in the views table (or the header; it is in mm), or check that MR volume and mammogram belong together"
        )
