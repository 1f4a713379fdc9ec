"""Where the search for a pose begins, and the pose of a case that has no image to compare with."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.geometry.frames import Points, plate_rotation
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.estimate import Compressed
from mammoreg.pose.scaling import fit_scaling
from mammoreg.pose.thickness import estimate_thickness
from stages.engine.contract import Array, Fields, Subject
from stages.pose.view_facts import Seen

THICKNESS_AT_BOUND = "estimated thickness at the bound of its search"
EDGE_QUANTILE = 0.25  # a plate's edge reaches in front of most, not all, of the breast's back


def start_view(
    seen: Seen, mesh: BlockMesh, compress: Callable[[ViewGeometry], Compressed | None]
) -> tuple[ViewGeometry, tuple[str, ...], tuple[str, ...]]:
    """Geometry from the volume-preserving scaling at the header's angle, the names of what was estimated, and doubts.

    Raises:
        DataError: the mammogram's thickness is no compression of this breast, or cannot be estimated.
    """
    if seen.placed:
        return seen.geometry, seen.estimated, ()
    turned = breast_to_plate(mesh.points, seen.geometry.angle_deg)
    view = replace(
        seen.geometry,
        edge_p_mm=float(np.quantile(turned[mesh.back_nodes(), 1], EDGE_QUANTILE)),
        middle_mm=float(turned[:, 0].mean()),
    )
    estimated = seen.estimated
    doubts: tuple[str, ...] = ()
    front = turned[turned[:, 1] < view.edge_p_mm, 2]
    height = float(np.ptp(front if len(front) else turned[:, 2]))
    if not np.isfinite(view.thickness_mm):
        facets = skin_facets(mesh.skin_quads(), len(mesh.points), 2)
        found = estimate_thickness(view, seen.outline, compress, facets, height)
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
    fitted = fit_scaling(mesh.points, mesh.skin_quads().astype(np.intp), view, seen.outline).alignment.view
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
    placed = {
        "angle_deg": 0.0,
        "edge_p_mm": edge,
        "middle_mm": float(mesh.points[:, 0].mean()),
        "height_mm": 0.5 * (low + high) - 0.5 * thickness,
        "thickness_mm": thickness,
    }
    ratio = 1.0 - share
    scale = np.array([ratio**-0.5, ratio**-0.5, ratio])
    anchor = np.array([placed["middle_mm"], float(back[:, 1].max()), 0.5 * (low + high)])
    return Fields(
        arrays={
            "rigid_matrix": Array(plate_rotation(0.0), "1", "method rigid, breast to plate frame"),
            "rigid_offset": Array(np.zeros(3), "mm", "method rigid, breast to plate frame"),
            "scaling_matrix": Array(np.diag(scale), "1", "method scaling, breast to plate frame"),
            "scaling_offset": Array(anchor - scale * anchor, "mm", "method scaling, breast to plate frame"),
        },
        values={
            **placed,
            **{f"rigid_{name}": value for name, value in placed.items()},
            "source_detector_mm": 1.0e7,
            "support_detector_mm": 0.0,
            "pixel_mm": 1.0,
            "rows": 400,
            "columns": 300,
            "plates_known": False,
            "drawn_mm": [0.0, 0.0, 0.0],
            "angle_determined": False,
            "estimated": ["angle_deg", "edge_p_mm", "thickness_mm"],
            "flags": [],
        },
    )
