"""Projection of volumes of the plate frame onto the detector."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats32
from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.projection.regular import interpolate_axis


def detector_pixels(view: ViewGeometry, step: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows and columns, in pixels of the full image, at the middles of blocks of `step` x `step` pixels."""
    rows = (np.arange(-(-view.rows // step)) + 0.5) * step - 0.5
    columns = (np.arange(-(-view.columns // step)) + 0.5) * step - 0.5
    return np.asarray(rows, dtype=float), np.asarray(columns, dtype=float)


def project_volume(volume: Volume, view: ViewGeometry, step: int = 4) -> Floats32:
    """Line integrals through a volume along the beams, at every `step`-th pixel.

    With a point source every slice of constant height is magnified about the source's foot, so that the integral is a
    sum of zoomed slices times the length of the beam within one of them.

    Args:
        volume: samples, such as attenuation in 1/mm, in the plate frame; zero outside its grid.
        view: cone beam, or parallel beams.
        step: side of the blocks of pixels, the middles of which are computed.

    Returns:
        Image (ceil(rows / step), ceil(columns / step)), canonical; without unit for an attenuation in 1/mm.
    """
    along, forward = _detector_mm(view, step)
    image: Floats32 = np.zeros((len(along), len(forward)), dtype=np.float32)
    for zoomed in _zoomed_slices(volume, view, along, forward):
        image += zoomed
    return np.asarray(image * float(volume.spacing[2]) * _obliquity(along, forward, view), dtype=np.float32)


def project_shadow(mask: Volume, view: ViewGeometry, step: int = 4) -> NDArray[np.bool_]:
    """Silhouette of a mask (0 to 1) of the plate frame: where a beam meets values above 0.5; arguments as above."""
    along, forward = _detector_mm(view, step)
    shadow: NDArray[np.bool_] = np.zeros((len(along), len(forward)), dtype=bool)
    for zoomed in _zoomed_slices(mask, view, along, forward):
        shadow |= zoomed > 0.5
    return shadow


def _detector_mm(view: ViewGeometry, step: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places along the chest-wall edge, from the middle row, and forward of it, mm at the detector."""
    rows, columns = detector_pixels(view, step)
    return (rows - 0.5 * (view.rows - 1)) * view.pixel_mm, (columns + 0.5) * view.pixel_mm


def _zoomed_slices(
    volume: Volume, view: ViewGeometry, along: NDArray[np.float64], forward: NDArray[np.float64]
) -> Iterator[Floats32]:
    """Each slice of constant height as the detector sees it."""
    heights = volume.origin[2] + volume.spacing[2] * np.arange(volume.shape[2])
    for level, zoom in enumerate(view.magnification(heights)):
        medial = (view.middle_mm + along / zoom - volume.origin[0]) / volume.spacing[0]
        posterior = (view.edge_p_mm - forward / zoom - volume.origin[1]) / volume.spacing[1]
        yield interpolate_axis(interpolate_axis(volume.data[:, :, level], medial, 0), posterior, 1)


def _obliquity(along: NDArray[np.float64], forward: NDArray[np.float64], view: ViewGeometry) -> NDArray[np.float64]:
    """Length of the beams to the pixels over the height that they pass, (rows, columns)."""
    if view.parallel:
        return np.ones((len(along), len(forward)))
    return np.asarray(np.sqrt(1.0 + (along[:, None] ** 2 + forward[None, :] ** 2) / view.source_detector_mm**2))
