"""How much of a breast its mammograms show: so deep its model must be."""

from pathlib import Path

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mammogram import analyse
from mammoreg.imaging.mammogram_canonical import canonicalise
from mammoreg.imaging.views import View
from stages.cohort.readers.mammogram.image import read_mammogram
from stages.engine.contract import Inputs, Subject
from stages.views import IMAGED


def imaged_mm(inputs: Inputs, subject: Subject) -> float | None:
    """Greatest distance, mm, from the chest-wall edge to the skin in a case's mammograms.

    Measured in the middle between the plates where their distance is known, else at the detector.

    None where there is none that can be used; what is wrong with it `pose` tells.
    """
    found = []
    for view in IMAGED:
        path, ending = inputs.path(f"image_{view}"), f"_{view}"
        if path is not None:
            row = {name.removesuffix(ending): text for name, text in subject.row.items() if name.endswith(ending)}
            found.append(_reach_mm(path, row, subject.laterality, view))
    return max((reach for reach in found if reach is not None), default=None)


def _reach_mm(path: Path, row: dict[str, str], side: Laterality, view: View) -> float | None:
    """Of one mammogram."""
    try:
        stored = read_mammogram(path, row, side, view)
        facts = stored.facts
        if facts.pixel_mm is None:
            return None
        image = canonicalise(
            stored.pixels,
            side,
            view,
            orientation=facts.orientation,
            photometric=facts.photometric,
            linear=facts.linear,
        )
        outline = analyse(image.pixels, facts.pixel_mm, view).outline
    except DataError:
        return None
    reach_mm = float(np.max(outline[:, 0]) + 0.5) * facts.pixel_mm
    if facts.thickness_mm is None:
        return reach_mm
    middle_mm = facts.support_detector_mm + 0.5 * facts.thickness_mm
    return reach_mm * (1.0 - middle_mm / facts.source_detector_mm)
