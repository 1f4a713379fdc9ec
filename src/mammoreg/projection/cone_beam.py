"""Projection of volumes of the plate frame onto the detector."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.projection.regular import interpolate_axis

Image = NDArray[np.float32]


def detector_pixels(view: ViewGeometry, step: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows and columns, in pixels of the full image, at the middles of blocks of `step` x `step` pixels."""
    rows = (np.arange(-(-view.rows // step)) + 0.5) * step - 0.5
    columns = (np.arange(-(-view.columns // step)) + 0.5) * step - 0.5
    return np.asarray(rows, dtype=float), np.asarray(columns, dtype=float)


def project_volume(volume: Volume, view: ViewGeometry, step: int = 4) -> Image:
    """Line integrals through a volume along the beams, at every `step`-th pixel.

    With a point source every slice of constant height is magnified about the source's foot, so that the integral is a
    sum of zoomed slices times the length of the beam within one of them.

    Args:
        volume: samples per mm (attenuation) or without unit (mask) in the plate frame; zero outside its grid.
        view: cone beam, or parallel beams.
        step: side of the blocks of pixels, the middles of which are computed.

    Returns:
        Image (ceil(rows / step), ceil(columns / step)), canonical: attenuation without unit, or mm for a mask.
    """
    rows, columns = detector_pixels(view, step)
    along = (rows - 0.5 * (view.rows - 1)) * view.pixel_mm
    forward = (columns + 0.5) * view.pixel_mm
    image: Image = np.zeros((len(rows), len(columns)), dtype=np.float32)
    heights = volume.origin[2] + volume.spacing[2] * np.arange(volume.shape[2])
    for level, zoom in enumerate(view.magnification(heights)):
        medial = (view.middle_mm + along / zoom - volume.origin[0]) / volume.spacing[0]
        posterior = (view.edge_p_mm - forward / zoom - volume.origin[1]) / volume.spacing[1]
        image += interpolate_axis(interpolate_axis(volume.data[:, :, level], medial, 0), posterior, 1)
    return np.asarray(image * float(volume.spacing[2]) * _obliquity(along, forward, view), dtype=np.float32)


def _obliquity(along: NDArray[np.float64], forward: NDArray[np.float64], view: ViewGeometry) -> NDArray[np.float64]:
    """Length of the beams to the pixels over the height that they pass, (rows, columns)."""
    if view.parallel:
        return np.ones((len(along), len(forward)))
    return np.asarray(np.sqrt(1.0 + (along[:, None] ** 2 + forward[None, :] ** 2) / view.source_detector_mm**2))
