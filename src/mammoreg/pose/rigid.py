"""Method `rigid`: the undeformed breast in parallel beams, brought onto the image without mechanics."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import breast_to_plate
from mammoreg.pose.alignment import align
from mammoreg.pose.outline import RadialOutline


def rigid_view(
    skin: Points,
    quads: NDArray[np.integer],
    view: ViewGeometry,
    outline: RadialOutline,
    nipple: Points,
    nipple_px: NDArray[np.float64] | None,
) -> ViewGeometry:
    """Geometry of the undeformed breast over the image.

    It is turned to the header's angle, projected by parallel beams, magnified for the plates' middle, and laid over the
    image by the nipple or, where that is not seen, by the outline.

    Args:
        skin: undeformed surface nodes (N, 3), breast frame, mm.
        quads: facets (Q, 4).
        view: header's angle, thickness and detector; edge and middle to start from.
        outline: of the image, used where the nipple is not seen.
        nipple: (3,) in the MR volume, breast frame.
        nipple_px: (2,) canonical (column, row) in the image, or None.
    """
    turned = breast_to_plate(skin, view.angle_deg)
    middle = 0.5 * (turned[:, 2].min() + turned[:, 2].max())
    flat = replace(view, parallel=True, height_mm=float(middle) - 0.5 * view.thickness_mm)
    if nipple_px is None:
        return align(turned, quads.astype(np.intp), flat, outline).view
    seen = flat.project(breast_to_plate(nipple, view.angle_deg))
    shift = (np.asarray(nipple_px) - seen) * flat.pixel_mm / flat.middle_magnification
    return replace(flat, edge_p_mm=flat.edge_p_mm + float(shift[0]), middle_mm=flat.middle_mm - float(shift[1]))
