"""A mammogram as pixels, and how it was taken."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry
from mammoreg.imaging.views import PROJECTIONS, View, view_named

DEFAULT_SOURCE_DETECTOR_MM = 650.0
DEFAULT_SUPPORT_DETECTOR_MM = 15.0
"""Of a usual unit, where nothing tells its own."""


@dataclass(frozen=True)
class Mammogram:
    r"""A mammogram and how it was taken.

    Attributes:
        pixels: as stored, (rows, columns), neither flipped nor inverted.
        view: one of `mammoreg.imaging.views.VIEWS`.
        pixel_mm: pixel spacing at the detector, mm.
        thickness_mm: distance of the plates, mm; None: estimated from the outline.
        angle_deg: projection angle a, degrees, CC a signed roll, MLO positive: in LPS the source lies along
            (-s sin a, 0, cos a) from the breast, with s = +1 for a left and -1 for a right one. None: the view's usual
            one (CC 0, MLO 45, ML 90, LM -90, LMO -135, FB 180). It is where the search for the true angle starts.
        source_detector_mm, support_detector_mm: height of source and support surface above the detector, mm.
        orientation: row and column direction as stored (PatientOrientation), such as ``A\R`` or ``P\FL``; None: by the
            side on which the image shows air.
        photometric: MONOCHROME1 or MONOCHROME2; None: by the air at the border.
        linear: whether grey values are proportional to exposure (unprocessed detector data).
    """

    pixels: NDArray[Any]
    view: View
    pixel_mm: float
    thickness_mm: float | None = None
    angle_deg: float | None = None
    source_detector_mm: float = DEFAULT_SOURCE_DETECTOR_MM
    support_detector_mm: float = DEFAULT_SUPPORT_DETECTOR_MM
    orientation: str | None = None
    photometric: str | None = None
    linear: bool = False

    def __post_init__(self) -> None:
        if np.ndim(self.pixels) != 2:
            raise DataError(f"a mammogram is an array of rows and columns, not of shape {np.shape(self.pixels)}")
        view_named(self.view)
        for name in ("pixel_mm", "thickness_mm"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise DataError(f"{name} {value!r} is not a positive number of millimetres")

    def geometry(self) -> ViewGeometry:
        """What is known of the view's geometry before the breast is found in it: edge, middle and height are not."""
        rows, columns = self.pixels.shape
        return ViewGeometry(
            angle_deg=PROJECTIONS[self.view].angle_deg if self.angle_deg is None else self.angle_deg,
            edge_p_mm=0.0,
            middle_mm=0.0,
            height_mm=0.0,
            thickness_mm=float("nan") if self.thickness_mm is None else self.thickness_mm,
            source_detector_mm=self.source_detector_mm,
            support_detector_mm=self.support_detector_mm,
            pixel_mm=self.pixel_mm,
            rows=rows,
            columns=columns,
        )
