"""The pose of a case that has no image to compare with."""

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import plate_rotation
from mammoreg.localization.deformation import AffineDeformation
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.start import EDGE_QUANTILE
from stages.engine.contract import Fields, Subject, Value
from stages.pose.record import PoseFields

FAR_SOURCE_MM = 1.0e7  # whose beams are parallel


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
