"""Images on the detector for pictures, from artefacts."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.plots.detector import DetectorImage
from stages.engine.artefact import Artefact

_SHOWN_MM = 0.4


def mammogram(pose: Artefact) -> DetectorImage:
    """A view's mammogram, thinned to what a picture resolves; black where the view has none."""
    pixel_mm, rows, columns = (float(pose.value("pixel_mm")), int(pose.value("rows")), int(pose.value("columns")))
    step = max(1, round(_SHOWN_MM / pixel_mm))
    breast = pose.array("breast_mask", "1") != 0 if pose.has("breast_mask") else np.ones((rows, columns), dtype=bool)
    image = pose.array("mammogram", "1") if pose.has("mammogram") else np.zeros((rows, columns))
    return DetectorImage(_block_means(image, step), breast[::step, ::step], pixel_mm, rows, step)


def projection(pose: Artefact, projected: Artefact, method: str) -> DetectorImage:
    """A method's projection of the deformed MR volume."""
    image, mask = projected.array(f"{method}/projection", "1"), projected.array(f"{method}/mask", "1") != 0
    pixel_mm, rows = float(pose.value("pixel_mm")), int(pose.value("rows"))
    return DetectorImage(image, mask, pixel_mm, rows, int(projected.value("step")))


def _block_means(image: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Means over blocks of step x step pixels; the last ones repeat the border."""
    rows, columns = image.shape
    padded = np.pad(np.asarray(image, dtype=float), ((0, -rows % step), (0, -columns % step)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // step, step, padded.shape[1] // step, step)
    return np.asarray(blocks.mean(axis=(1, 3)))
