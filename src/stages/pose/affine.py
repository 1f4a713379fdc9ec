"""The methods without mechanics, `rigid` and `scaling`, as affine maps for the pose artefact."""

from dataclasses import replace

import numpy as np

from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import Points, plate_rotation
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.rigid import rigid_view
from mammoreg.pose.scaling import fit_scaling
from stages.engine.contract import Array, Value
from stages.pose.view_facts import Seen


def affine_arrays(mesh: BlockMesh, start: ViewGeometry, view: ViewGeometry, seen: Seen) -> dict[str, Array]:
    """Matrices and offsets of both methods, from the breast to the plate frame of `view`.

    Args:
        mesh: undeformed, breast frame.
        start: header's angle and the place that scaling found there.
        view: the estimated pose, whose angle scaling takes too.
        seen: the view.
    """
    quads = mesh.skin_quads().astype(np.intp)
    scaling = fit_scaling(mesh.points, quads, view, seen.outline, keep_height=True)
    placed = scaling.alignment.view
    # The artefact holds one geometry for all but `rigid`, so scaling's own shift goes into its map.
    shift = np.array([view.middle_mm - placed.middle_mm, view.edge_p_mm - placed.edge_p_mm, 0.0])
    return {
        "rigid_matrix": Array(plate_rotation(start.angle_deg), "1", "method rigid, breast to plate frame"),
        "rigid_offset": Array(np.zeros(3), "mm", "method rigid, breast to plate frame"),
        "scaling_matrix": Array(scaling.matrix, "1", "method scaling, breast to plate frame"),
        "scaling_offset": Array(scaling.offset + shift, "mm", "method scaling, breast to plate frame"),
    }


def rigid_values(mesh: BlockMesh, start: ViewGeometry, seen: Seen, nipple: Points) -> dict[str, Value]:
    """Geometry of method rigid: at the header's angle, aligned on nipples or, where one is not seen, on outlines."""
    header = replace(start, angle_deg=seen.geometry.angle_deg)
    view = rigid_view(mesh.points, mesh.skin_quads(), header, seen.outline, nipple, seen.nipple)
    return {
        "rigid_angle_deg": view.angle_deg,
        "rigid_edge_p_mm": view.edge_p_mm,
        "rigid_middle_mm": view.middle_mm,
        "rigid_height_mm": view.height_mm,
        "rigid_thickness_mm": view.thickness_mm,
    }
