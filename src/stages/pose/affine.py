"""The methods without mechanics, `rigid` and `scaling`: their maps and the geometry of `rigid`."""

from dataclasses import replace

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import plate_rotation
from mammoreg.localization.deformation import AffineDeformation
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.outlined import OutlinedView
from mammoreg.pose.rigid import rigid_view
from mammoreg.pose.scaling import fit_scaling


def affine_maps(
    mesh: BlockMesh, start: ViewGeometry, view: ViewGeometry, seen: OutlinedView
) -> dict[str, AffineDeformation]:
    """Maps of both methods by name, from the breast to the plate frame of `view`.

    Args:
        mesh: undeformed, breast frame.
        start: header's angle and the place that scaling found there.
        view: the estimated pose, whose angle scaling takes too.
        seen: what the view shows.
    """
    quads = mesh.skin_quads().astype(np.intp)
    scaling = fit_scaling(mesh.points, quads, view, seen.outline, keep_height=True)
    placed = scaling.alignment.view
    # The artefact holds one geometry for all but `rigid`, so scaling's own shift goes into its map.
    shift = np.array([view.middle_mm - placed.middle_mm, view.edge_p_mm - placed.edge_p_mm, 0.0])
    return {
        "rigid": AffineDeformation(plate_rotation(start.angle_deg), np.zeros(3)),
        "scaling": AffineDeformation(scaling.matrix, scaling.offset + shift),
    }


def rigid_geometry(mesh: BlockMesh, start: ViewGeometry, seen: OutlinedView, nipple: Points) -> ViewGeometry:
    """Geometry of method rigid: at the header's angle, aligned on nipples or, where one is not seen, on outlines."""
    header = replace(start, angle_deg=seen.geometry.angle_deg)
    return rigid_view(mesh.points, mesh.skin_quads(), header, seen.outline, nipple, seen.nipple)
