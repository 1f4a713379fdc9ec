"""The cone-beam geometry of one mammogram."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points


@dataclass(frozen=True)
class ViewGeometry:
    """Where plates, detector and source stand in the plate frame; see the package docstring.

    The image is canonical: column 0 lies at the chest-wall edge and columns count towards the nipple; rows count
    towards medial (the plate frame's first axis). Pixel indices are those of pixel centres.

    Attributes:
        angle_deg: projection angle a.
        edge_p_mm: posterior coordinate of the image's chest-wall edge (outer border of column 0).
        middle_mm: medial plate coordinate of the image's middle row.
        height_mm: height of the lower plate's surface, which carries the breast.
        thickness_mm: plate gap.
        source_detector_mm: source-to-detector distance.
        support_detector_mm: height of the lower plate's surface above the detector.
        pixel_mm: pixel spacing at the detector.
        rows, columns: size of the image.
        parallel: parallel beams magnified for the plates' middle (method `rigid`) instead of the cone.
    """

    angle_deg: float
    edge_p_mm: float
    middle_mm: float
    height_mm: float
    thickness_mm: float
    source_detector_mm: float
    support_detector_mm: float
    pixel_mm: float
    rows: int
    columns: int
    parallel: bool = False

    @property
    def detector_height_mm(self) -> float:
        """Height of the detector plane in the plate frame."""
        return self.height_mm - self.support_detector_mm

    @property
    def source(self) -> Points:
        """Source position (3,) in the plate frame: above the chest-wall edge, in the middle row."""
        return np.array([self.middle_mm, self.edge_p_mm, self.detector_height_mm + self.source_detector_mm])

    @property
    def middle_magnification(self) -> float:
        """Magnification at half the plate gap; distances on the detector divided by it are those in the breast."""
        return self.source_detector_mm / (self.source_detector_mm - self.support_detector_mm - 0.5 * self.thickness_mm)

    def magnification(self, height: NDArray[np.float64]) -> NDArray[np.float64]:
        """Magnification of points at plate-frame heights in mm, any shape."""
        height = np.asarray(height, dtype=float)
        if self.parallel:
            return np.full_like(height, self.middle_magnification)
        return np.asarray(self.source_detector_mm / (self.source[2] - height))

    def project(self, points: Points) -> NDArray[np.float64]:
        """Project points (..., 3) of the plate frame, mm, to pixels (..., 2) as (column, row)."""
        points = np.asarray(points, dtype=float)
        zoom = self.magnification(points[..., 2])
        forward = (self.edge_p_mm - points[..., 1]) * zoom
        along = (points[..., 0] - self.middle_mm) * zoom
        column = forward / self.pixel_mm - 0.5
        row = along / self.pixel_mm + 0.5 * (self.rows - 1)
        return np.stack([column, row], axis=-1)

    def back_project(self, pixels: NDArray[np.float64], height: NDArray[np.float64]) -> Points:
        """Points (..., 3) of the plate frame at given heights, mm, on the beams to pixels (..., 2) (column, row)."""
        pixels = np.asarray(pixels, dtype=float)
        zoom = self.magnification(height)
        posterior = self.edge_p_mm - (pixels[..., 0] + 0.5) * self.pixel_mm / zoom
        medial = self.middle_mm + (pixels[..., 1] - 0.5 * (self.rows - 1)) * self.pixel_mm / zoom
        return np.stack(np.broadcast_arrays(medial, posterior, np.asarray(height, dtype=float)), axis=-1)
