"""The coil's inhomogeneity by N4 (Tustison et al. 2010), from ITK."""

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume

SHRINK = 4
ITERATIONS = (20, 20, 20)


def n4_field(volume: Volume, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Smooth multiplicative field of an MR volume, of geometric mean 1 inside the mask; the volume's shape.

    Fitted on every fourth voxel of the mask, with one thread, so that a rerun is identical.
    """
    import SimpleITK

    image = SimpleITK.GetImageFromArray(np.ascontiguousarray(volume.data.transpose(2, 1, 0)))
    inside = SimpleITK.GetImageFromArray(np.ascontiguousarray(mask.transpose(2, 1, 0)).astype(np.uint8))
    corrector = SimpleITK.N4BiasFieldCorrectionImageFilter()
    corrector.SetNumberOfThreads(1)
    corrector.SetMaximumNumberOfIterations(ITERATIONS)
    positive = SimpleITK.Maximum(image, 1e-3)
    corrector.Execute(SimpleITK.Shrink(positive, [SHRINK] * 3), SimpleITK.Shrink(inside, [SHRINK] * 3))
    logs = SimpleITK.GetArrayFromImage(corrector.GetLogBiasFieldAsImage(image)).transpose(2, 1, 0)
    return np.asarray(np.clip(np.exp(logs - logs[mask].mean()), 0.1, 10.0), dtype=np.float32)
