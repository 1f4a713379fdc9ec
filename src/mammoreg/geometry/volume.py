"""An axis-aligned volume in one of the frames of this package."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry.frames import Frame, Laterality


@dataclass(frozen=True)
class Volume:
    """Samples on a regular grid whose array axes run along +x, +y, +z of its frame.

    Attributes:
        data: samples, shape (nx, ny, nz).
        origin: centre of voxel (0, 0, 0), shape (3,), mm.
        spacing: distance of voxel centres, shape (3,), mm, all positive.
        frame: in which origin and axes are.
    """

    data: NDArray[Any]
    origin: NDArray[np.float64]
    spacing: NDArray[np.float64]
    frame: Frame = "breast"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along each axis."""
        nx, ny, nz = self.data.shape
        return nx, ny, nz

    @property
    def voxel_mm3(self) -> float:
        """Volume of one voxel in mm3."""
        return float(np.prod(self.spacing))

    def to_index(self, points: Points) -> Points:
        """Fractional voxel indices (..., 3) of points (..., 3) in mm."""
        return (np.asarray(points, dtype=float) - self.origin) / self.spacing

    def to_world(self, indices: NDArray[Any]) -> Points:
        """Positions (..., 3) in mm of voxel indices (..., 3)."""
        return np.asarray(indices, dtype=float) * self.spacing + self.origin

    def centres(self, mask: NDArray[np.bool_]) -> Points:
        """Centres (N, 3) in mm of the voxels that a mask of the same shape selects, in C order."""
        return self.to_world(np.argwhere(mask))

    def sample(self, points: Points, order: Literal[0, 1] = 1, outside: float = 0.0) -> NDArray[np.float64]:
        """Interpolate at points (..., 3) in mm; `order` 0 is nearest, 1 is linear; `outside` fills beyond the grid."""
        index = np.moveaxis(self.to_index(points), -1, 0)
        from scipy import ndimage  # when it is needed: it takes half a second to import

        values = ndimage.map_coordinates(
            self.data.astype(np.float32, copy=False), index, order=order, mode="constant", cval=outside, prefilter=False
        )
        return np.asarray(values, dtype=float)

    def with_data(self, data: NDArray[Any]) -> "Volume":
        """The same grid with other samples."""
        if data.shape != self.data.shape:
            raise ValueError(f"samples of shape {data.shape} do not fit a grid of shape {self.data.shape}")
        return replace(self, data=data)

    def to_breast(self, laterality: Laterality) -> "Volume":
        """The same LPS volume in the breast frame.

        Raises:
            ValueError: it is in another frame.
        """
        return self._mirrored("LPS", "breast", laterality)

    def to_lps(self, laterality: Laterality) -> "Volume":
        """The same volume of the breast frame in LPS.

        Raises:
            ValueError: it is in another frame.
        """
        return self._mirrored("breast", "LPS", laterality)

    def _mirrored(self, start: Frame, end: Frame, laterality: Laterality) -> "Volume":
        """In the other of LPS and breast frame: mirrored in x for a left breast."""
        if self.frame != start:
            raise ValueError(f"a volume of the {self.frame} frame is not one of the {start} frame")
        if laterality == "R":
            return replace(self, frame=end)
        origin = self.origin.copy()
        origin[0] = -(self.origin[0] + (self.shape[0] - 1) * self.spacing[0])
        return Volume(np.ascontiguousarray(self.data[::-1]), origin, self.spacing, end)
