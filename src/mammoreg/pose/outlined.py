"""A view before its pose is known: what its image shows of the breast."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.acquisition import Mammogram
from mammoreg.imaging.mammogram import MammogramAnalysis, analyse
from mammoreg.imaging.mammogram_canonical import CanonicalMammogram, canonicalise
from mammoreg.pose.density import DensityImage, mammogram_structure
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import pixels_at_detector, ray_angles

OUTLINE_RAYS = 181
"""Rays on which a model is brought onto an outline: one a degree."""


@dataclass(frozen=True)
class OutlinedView:
    """What the search for a pose compares a model with.

    Attributes:
        geometry: angle, thickness (nan where unknown), source, detector; of the rest only a second volume knows.
        outline: on rays, mm at the detector.
        placed: whether edge, middle and height are known (second volume).
        density: dense tissue of a mammogram.
        nipple: (2,) canonical (column, row), or None.
    """

    geometry: ViewGeometry
    outline: RadialOutline
    placed: bool = False
    density: DensityImage | None = None
    nipple: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class OutlinedMammogram:
    """A mammogram in canonical orientation, what was found in it, and the view that this makes."""

    image: CanonicalMammogram
    found: MammogramAnalysis
    view: OutlinedView


def outlined_mammograms(mammogram: Mammogram, laterality: Laterality) -> tuple[OutlinedMammogram, ...]:
    """The mammogram as its orientation tells, or, without one, in both orders of its rows, the usual one first.

    Raises:
        DataError: as `outlined_mammogram`.
    """
    orders = (False,) if mammogram.orientation is not None else (False, True)
    return tuple(outlined_mammogram(mammogram, laterality, turned) for turned in orders)


def outlined_mammogram(mammogram: Mammogram, laterality: Laterality, turned: bool = False) -> OutlinedMammogram:
    """Turn a mammogram into canonical orientation and find breast, outline, dense tissue and nipple.

    Args:
        mammogram: as stored.
        laterality: of the breast.
        turned: take rows to run the other way than usually; only without an orientation.

    Raises:
        DataError: the image shows no usable breast, or contradicts its orientation.
    """
    image = canonicalise(
        mammogram.pixels,
        laterality,
        mammogram.view,
        orientation=mammogram.orientation,
        photometric=mammogram.photometric,
        linear=mammogram.linear,
        turned=turned,
    )
    found, geometry = analyse(image.pixels, mammogram.pixel_mm, mammogram.view), mammogram.geometry()
    breast = found.mask if found.pectoral is None else found.mask & ~found.pectoral
    return OutlinedMammogram(
        image,
        found,
        OutlinedView(
            geometry,
            radial_outline(pixels_at_detector(found.outline, geometry), found.outline_weight, ray_angles(OUTLINE_RAYS)),
            density=mammogram_structure(image.pixels, breast, mammogram.pixel_mm),
            nipple=found.nipple,
        ),
    )
