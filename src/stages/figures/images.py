"""Images on the detector for pictures, from artefacts."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.plots.detector import DetectorImage
from stages.pose.record import PoseRecord
from stages.project.record import ProjectRecord

_SHOWN_MM = 0.4


def mammogram(pose: PoseRecord) -> DetectorImage:
    """A view's mammogram, thinned to what a picture resolves; black where the view has none."""
    pixel_mm, rows, columns = pose.geometry.pixel_mm, pose.geometry.rows, pose.geometry.columns
    step = max(1, round(_SHOWN_MM / pixel_mm))
    breast = pose.tissue != 0 if pose.has_mammogram else np.ones((rows, columns), dtype=bool)
    image = pose.mammogram if pose.has_mammogram else np.zeros((rows, columns))
    return DetectorImage(_block_means(image, step), breast[::step, ::step], pixel_mm, rows, step)


def projection(pose: PoseRecord, projected: ProjectRecord, method: str) -> DetectorImage:
    """A method's projection of the deformed MR volume."""
    image, mask = projected.projection(method), projected.silhouette(method)
    return DetectorImage(image, mask, pose.geometry.pixel_mm, pose.geometry.rows, projected.step)


def _block_means(image: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Means over blocks of step x step pixels; the last ones repeat the border."""
    rows, columns = image.shape
    padded = np.pad(np.asarray(image, dtype=float), ((0, -rows % step), (0, -columns % step)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // step, step, padded.shape[1] // step, step)
    return np.asarray(blocks.mean(axis=(1, 3)))
