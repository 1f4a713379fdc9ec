"""Where the search for a pose begins, and the pose of a case that has no image to compare with."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.geometry.frames import Points, plate_rotation
from mammoreg.localization.deformation import AffineDeformation
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.estimate import Compressed
from mammoreg.pose.scaling import fit_scaling
from mammoreg.pose.thickness import estimate_thickness
from stages.engine.contract import Fields, Subject, Value
from stages.pose.record import PoseFields
from stages.pose.view_facts import ViewFacts

THICKNESS_AT_BOUND = "estimated thickness at the bound of its search"
FAR_SOURCE_MM = 1.0e7  # whose beams are parallel
EDGE_QUANTILE = 0.25  # chosen: a plate's edge reaches in front of most, not all, of the breast's back


def start_view(
    facts: ViewFacts, mesh: BlockMesh, compress: Callable[[ViewGeometry], Compressed | None]
) -> tuple[ViewGeometry, tuple[str, ...], tuple[str, ...]]:
    """Geometry from the volume-preserving scaling at the header's angle, the names of what was estimated, and doubts.

    Raises:
        DataError: the mammogram's thickness is no compression of this breast, or cannot be estimated.
    """
    if facts.placed:
        return facts.geometry, facts.estimated, ()
    turned = breast_to_plate(mesh.points, facts.geometry.angle_deg)
    view = replace(
        facts.geometry,
        edge_p_mm=float(np.quantile(turned[mesh.back_nodes(), 1], EDGE_QUANTILE)),
        middle_mm=float(turned[:, 0].mean()),
    )
    estimated = facts.estimated
    doubts: tuple[str, ...] = ()
    front = turned[turned[:, 1] < view.edge_p_mm, 2]
    height = float(np.ptp(front if len(front) else turned[:, 2]))
    if not np.isfinite(view.thickness_mm):
        facets = skin_facets(mesh.skin_quads(), len(mesh.points), 2)
        found = estimate_thickness(view, facts.outline, compress, facets, height)
        if found is None:
            raise DataError("the compressed thickness is unknown and cannot be estimated; give thickness_mm")
        view = replace(view, thickness_mm=found.thickness_mm)
        doubts = (THICKNESS_AT_BOUND,) if found.at_bound else ()
        estimated = tuple(dict.fromkeys((*estimated, "thickness_mm")))
    if view.thickness_mm >= height:
        raise DataError(
            f"the compressed thickness of {view.thickness_mm:.1f} mm is not below the uncompressed breast's "
            f"{height:.1f} mm; correct thickness_mm in the views table (or the header), or check the MR volume's side"
        )
    fitted = fit_scaling(mesh.points, mesh.skin_quads().astype(np.intp), view, facts.outline).alignment.view
    _refuse_runaway(turned, fitted, height)
    return fitted, estimated, doubts


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


def without_image(mesh: BlockMesh, subject: Subject) -> Fields:
    """Pose of a case with neither mammogram nor second volume: plates that take away the table's share.

    Raises:
        DataError: the table gives no compression.
    """
    share = subject.number("compression")
    if share is None:
        raise DataError("neither a mammogram, nor mr_compressed, nor compression is given for this case")
    back = mesh.points[mesh.back_nodes()]
    edge = float(np.quantile(back[:, 1], EDGE_QUANTILE))
    front = mesh.points[mesh.points[:, 1] < edge]
    low, high = float(front[:, 2].min()), float(front[:, 2].max())
    thickness = (1.0 - share) * (high - low)
    ratio, middle = 1.0 - share, 0.5 * (low + high)
    view = ViewGeometry(
        angle_deg=0.0,
        edge_p_mm=edge,
        middle_mm=float(mesh.points[:, 0].mean()),
        height_mm=middle - 0.5 * thickness,
        thickness_mm=thickness,
        source_detector_mm=FAR_SOURCE_MM,
        support_detector_mm=0.0,
        pixel_mm=1.0,
        rows=400,
        columns=300,
    )
    scale = np.array([ratio**-0.5, ratio**-0.5, ratio])
    anchor = np.array([view.middle_mm, float(back[:, 1].max()), middle])
    maps = {
        "rigid": AffineDeformation(plate_rotation(0.0), np.zeros(3)),
        "scaling": AffineDeformation(np.diag(scale), anchor - scale * anchor),
    }
    estimated = ("angle_deg", "edge_p_mm", "thickness_mm")
    known: dict[str, Value] = {"angle_determined": False}
    return PoseFields(view, view, maps, drawn_mm=(0.0, 0.0, 0.0), estimated=estimated, values=known).fields()
