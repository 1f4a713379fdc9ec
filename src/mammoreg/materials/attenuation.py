"""X-ray attenuation of the label map's tissues."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mammoreg.labels import Label

ATTENUATION_20KEV_PER_MM: Mapping[Label, float] = {
    Label.BACKGROUND: 0.0,
    Label.FAT: 0.051255,
    Label.GLAND: 0.076727,
    Label.SKIN: 0.084098,
    Label.MUSCLE: 0.086455,
}
"""Linear attenuation at 20 keV, 1/mm.

PENELOPE 2006 tables of VICTRE_PIPELINE (CC0 1.0), total with Rayleigh scattering, at densities of 0.92 (adipose), 1.035
(glandular), 1.09 (skin) and 1.05 g/cm3 (muscle). Air, 0.000094 per mm, counts as nothing.
"""


def attenuation_map(labels: NDArray[np.integer]) -> NDArray[np.float32]:
    """Attenuation in 1/mm, float32, of tissue labels, any shape."""
    table = np.array([ATTENUATION_20KEV_PER_MM[label] for label in Label], dtype=np.float32)
    return np.asarray(table[labels], dtype=np.float32)
