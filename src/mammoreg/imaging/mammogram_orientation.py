"""From the stored to the canonical orientation of a mammogram, by flips alone."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.views import PROJECTIONS, View

_OPPOSITE = {"A": "P", "P": "A", "L": "R", "R": "L", "F": "H", "H": "F"}


@dataclass(frozen=True)
class Flips:
    """Which axes of the stored image are reversed to make it canonical.

    Canonical: column 0 at the chest wall, columns towards the nipple, rows along the plate frame's first axis: towards
    medial in CC, medial and the feet in MLO, the feet in ML, the head in LM, the head and lateral in LMO, lateral in
    FB. Flips commute and undo themselves, so the same object maps both ways.
    """

    rows: bool
    columns: bool

    def apply(self, image: NDArray[Any]) -> NDArray[Any]:
        """Flip an image (rows, columns) between stored and canonical orientation."""
        flipped = image[::-1] if self.rows else image
        return np.ascontiguousarray(flipped[:, ::-1] if self.columns else flipped)

    def apply_to_pixels(self, pixels: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
        """Flip pixel positions (..., 2) as (column, row) in an image of shape (rows, columns)."""
        flipped = np.array(pixels, dtype=float, copy=True)
        if self.columns:
            flipped[..., 0] = shape[1] - 1 - flipped[..., 0]
        if self.rows:
            flipped[..., 1] = shape[0] - 1 - flipped[..., 1]
        return flipped

    @property
    def chest_wall_side(self) -> Literal["left", "right"]:
        """The side of the stored image at which the chest wall lies."""
        return "right" if self.columns else "left"


def flips_of_orientation(orientation: str, laterality: Laterality, view: View) -> Flips:
    r"""Decide the flips from PatientOrientation, side and view.

    Usual values are ``A\R`` (left CC), ``P\L`` (right CC), ``A\FR`` (left MLO), ``P\FL`` (right MLO), ``A\F`` (left
    ML and LM) and ``P\F`` (right ones).

    Args:
        orientation: row direction and column direction as stored, such as ``A\FR``; one letter of each is enough.

    Raises:
        DataError: If the value cannot be read, the image is turned by 90 degrees, or its letters contradict the side.
    """
    row_letters, column_letters = _two_directions(orientation)
    if not set(row_letters) & {"A", "P"}:
        raise DataError(
            f"orientation {orientation!r}: rows of pixels do not run along the antero-posterior axis; store the image "
            "with the chest wall at its left or right edge, or correct the column 'orientation'"
        )
    return Flips(rows=_rows_run_backwards(column_letters, orientation, laterality, view), columns="P" in row_letters)


def orientation_of_flips(flips: Flips, laterality: Laterality, view: View) -> str:
    r"""PatientOrientation, such as ``A\FR``, of an image that these flips make canonical."""
    forwards = sorted(_rows_towards(laterality, view))
    letters = [_OPPOSITE[letter] for letter in forwards] if flips.rows else forwards
    return f"{'P' if flips.columns else 'A'}\\{''.join(letters)}"


def _rows_towards(laterality: Laterality, view: View) -> frozenset[str]:
    """Letters of the directions in which canonical rows run."""
    across = {"M": "R", "T": "L"} if laterality == "L" else {"M": "L", "T": "R"}
    return frozenset(across.get(letter, letter) for letter in PROJECTIONS[view].rows_towards)


def _two_directions(orientation: str) -> tuple[str, str]:
    parts = [part.strip().upper() for part in orientation.replace("/", "\\").split("\\")]
    valid = len(parts) == 2 and all(parts) and all(_is_direction(part) for part in parts)
    if not valid:
        raise DataError(
            f"orientation {orientation!r} is not a pair of directions; write the row and the column direction of the "
            r"stored image with the letters A P L R F H, as in 'A\R' or 'P\FL'"
        )
    return parts[0], parts[1]


def _is_direction(letters: str) -> bool:
    known = set(letters) <= set(_OPPOSITE)
    return known and not any(_OPPOSITE[letter] in letters for letter in letters)


def _rows_run_backwards(letters: str, orientation: str, laterality: Laterality, view: View) -> bool:
    forwards = _rows_towards(laterality, view)
    backwards = {_OPPOSITE[letter] for letter in forwards}
    towards, away = set(letters) & forwards, set(letters) & backwards
    if bool(towards) == bool(away):
        problem = "contradicts" if towards else "does not tell the row order of"
        raise DataError(
            f"orientation {orientation!r} {problem} a {laterality} {view} view, whose rows run towards "
            f"{'/'.join(sorted(forwards))} or {'/'.join(sorted(backwards))}; check laterality, view and orientation"
        )
    return bool(away)
