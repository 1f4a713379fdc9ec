"""Canonical mammograms: one orientation, dense tissue bright."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mammogram_air import Air, find_air
from mammoreg.imaging.mammogram_frame import without_frame
from mammoreg.imaging.mammogram_orientation import Flips, flips_of_orientation
from mammoreg.imaging.views import PROJECTIONS, View


@dataclass(frozen=True)
class CanonicalMammogram:
    """A mammogram in canonical orientation and polarity.

    Attributes:
        pixels: float32 (rows, columns), bright = dense, grows with attenuation.
        air: level and noise of the air in `pixels`.
        flips: between stored and canonical orientation.
        estimated: names of what the header did not give.
    """

    pixels: NDArray[np.float32]
    air: Air
    flips: Flips
    estimated: tuple[str, ...]


def canonicalise(
    stored: NDArray[Any],
    laterality: Laterality,
    view: View,
    *,
    orientation: str | None = None,
    photometric: str | None = None,
    linear: bool = False,
    turned: bool = False,
) -> CanonicalMammogram:
    """Bring a stored mammogram into canonical orientation and polarity.

    Args:
        stored: pixels as stored, (rows, columns).
        orientation: PatientOrientation, or None: then the image's air tells the chest-wall side, and rows are taken to
            run as usually stored, as a unit hangs them: superior, or of a flat view lateral, first.
        photometric: PhotometricInterpretation, or None: then the air at the border decides.
        linear: True where grey values are proportional to exposure (unprocessed data), which takes a logarithm.
        turned: without an orientation, take rows to run the other way.

    Raises:
        DataError: If no breast is seen, or the image contradicts its orientation or its polarity.
    """
    framed = without_frame(stored)
    air = find_air(framed)
    flips = _flips(air, orientation, laterality, view, turned)
    _refuse_contradiction(photometric, air, linear)
    pixels = _dense_bright(framed, air, linear)
    missing = {"orientation": orientation, "polarity": photometric}
    canonical = np.asarray(flips.apply(pixels), dtype=np.float32)
    estimated = tuple(name for name, value in missing.items() if value is None)
    return CanonicalMammogram(canonical, find_air(canonical), flips, estimated)


def _flips(air: Air, orientation: str | None, laterality: Laterality, view: View, turned: bool) -> Flips:
    if orientation is None:
        return Flips(rows=turned == PROJECTIONS[view].hung_as_canonical, columns=air.side == "left")
    flips = flips_of_orientation(orientation, laterality, view)
    if flips.chest_wall_side == air.side:
        raise DataError(
            f"orientation {orientation!r} puts the chest wall at the {flips.chest_wall_side} edge of the image, which "
            "shows air; correct the orientation or the image"
        )
    return flips


def _refuse_contradiction(photometric: str | None, air: Air, linear: bool) -> None:
    if photometric is None or linear or air.bright == (photometric.strip().upper() == "MONOCHROME1"):
        return
    found = "brighter" if air.bright else "darker"
    raise DataError(
        f"PhotometricInterpretation is {photometric.strip()}, but the image's border is {found} than its middle: the "
        "polarity is wrong, or a frame, a label or a shutter covers the air; export the image again without it, or "
        "correct PhotometricInterpretation"
    )


def _dense_bright(pixels: NDArray[np.float32], air: Air, linear: bool) -> NDArray[np.float32]:
    if linear and air.bright:
        return np.asarray(np.log(max(air.level, 1.0)) - np.log(np.maximum(pixels, 1.0)), dtype=np.float32)
    if air.bright:
        return np.asarray(pixels.max() - pixels, dtype=np.float32)
    return pixels
