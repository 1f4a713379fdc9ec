"""Numbers of a mammogram: a column of the table before the header's element, each in its unit and possible."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydicom.dataset import Dataset

from mammoreg.errors import DataError
from mammoreg.imaging.views import View
from stages.cohort.readers.header_values import number, quoted, texts
from stages.cohort.readers.mammogram.projection_angle import is_no_angle, projection_angle

THICKNESS_MM = (10.0, 160.0)
"""Distances of the plates that a breast is pressed to (chosen: wider than any that is reported)."""
SOURCE_DETECTOR_MM = (300.0, 1500.0)
PIXEL_MM = (0.01, 1.0)
LARGEST_SUPPORT_DETECTOR_MM = 60.0
LARGEST_FORCE_N = 300.0
"""No unit presses with more."""
_UNITS = (("cm", 10.0), ("m", 1000.0))
_SPACINGS = ("ImagerPixelSpacing", "NominalScannedPixelSpacing", "PixelSpacing")
_QUOTED = 24


class Numbers:
    """The numbers of one image; what was noticed in reading gathers in `flags`."""

    def __init__(self, path: Path, header: Dataset, row: Mapping[str, str]) -> None:
        self.path, self.header, self.row = path, header, row
        self.flags: list[str] = []

    def fault(self, what: str, remedy: str) -> DataError:
        """An error about this image."""
        return DataError(f"{self.path}: {what}; {remedy}")

    def pixel_mm(self) -> float | None:
        """Pixel spacing at the detector."""
        value = self._column("pixel_spacing_mm")
        if value is None:
            value = self._spacing()
        low, high = PIXEL_MM
        if value is not None and not low <= value <= high:
            what = f"a pixel spacing of {value:g} mm is impossible ({low:g} to {high:g} mm)"
            raise self.fault(what, "correct it or give the column pixel_spacing_mm")
        return value

    def thickness_mm(self) -> float | None:
        """Distance of the plates."""
        return self._length("thickness_mm", "BodyPartThickness", THICKNESS_MM)

    def source_detector_mm(self) -> float | None:
        """Distance of source and detector."""
        return self._length("source_detector_mm", "DistanceSourceToDetector", SOURCE_DETECTOR_MM)

    def support_detector_mm(self) -> float | None:
        """Height of the support surface above the detector; no result rests on it so much that it stops one."""
        detector = self._in_millimetres("DistanceSourceToDetector", self._quiet("DistanceSourceToDetector"))
        patient = self._in_millimetres("DistanceSourceToPatient", self._quiet("DistanceSourceToPatient"))
        if detector is None or patient is None or patient >= detector:
            return None
        if detector - patient > LARGEST_SUPPORT_DETECTOR_MM:
            self.flags.append(f"support {detector - patient:g} mm above the detector is not believed")
            return None
        return detector - patient

    def force_n(self) -> float | None:
        """Plate force. It is shown and compared, not computed with, so that a strange one is only flagged."""
        force = self._column("force_n")
        if force is None:
            force = self._quiet("CompressionForce")
        if force is None:
            return None
        if force > LARGEST_FORCE_N and force / 10.0 <= LARGEST_FORCE_N:
            # One vendor writes tenths of a newton.
            self.flags.append(f"CompressionForce {force:g} read as dN")
            return force / 10.0
        if force > LARGEST_FORCE_N:
            self.flags.append(f"CompressionForce {force:g} N is no force of a mammography unit")
        return force

    def angle_deg(self, view: View) -> float | None:
        """Projection angle a."""
        value = self._column("angle_deg", positive=False)
        if value is None:
            value = self._element("PositionerPrimaryAngle", "angle_deg", zero=not is_no_angle(view))
        if value is None:
            return None
        try:
            angle, remark = projection_angle(value, view)
        except DataError as error:
            raise self.fault(str(error), "correct the header or the column angle_deg") from error
        self.flags += [remark] if remark else []
        return angle

    def _column(self, column: str, positive: bool = True) -> float | None:
        written = self.row.get(column, "").strip()
        if not written:
            return None
        value = number(written)
        if value is None or value.comma:
            raise DataError(f"views.tsv: {column} {written!r} of {self.path.name} is not a number; correct it")
        if positive and value.value <= 0.0:
            raise self.fault(f"{column} {value.value:g} is not positive", f"correct the column {column}")
        return value.value

    def _element(self, keyword: str, column: str, zero: bool = False) -> float | None:
        """An element of the header; zero, which vendors write for unknown, counts as missing unless it may be meant.

        Raises:
            DataError: it is no number.
        """
        written = texts(self.header, keyword)
        if not any(written):
            return None
        values = self._parsed(keyword, written)
        if values is None:
            what = f"{keyword} {quoted(written)[:_QUOTED]!r} is not a number"
            raise self.fault(what, f"give the column {column}, which overrides it")
        return values[0] if values[0] != 0.0 or zero else None

    def _quiet(self, keyword: str) -> float | None:
        """An element that no column overrides: one that is no positive number counts as missing."""
        written = texts(self.header, keyword)
        values = self._parsed(keyword, written) if any(written) else ()
        if values is None or (values and values[0] < 0.0):
            self.flags.append(f"{keyword} is no number that it can be, and is not used")
            return None
        return values[0] or None if values else None

    def _parsed(self, keyword: str, written: Sequence[str]) -> tuple[float, ...] | None:
        """All values of an element; None where one is no number."""
        found = [number(value) for value in written]
        values = tuple(one.value for one in found if one is not None)
        remark = f"{keyword} {' x '.join(written)} read with a decimal comma"
        if any(one is not None and one.comma for one in found) and remark not in self.flags:
            self.flags.append(remark)
        return values if len(values) == len(found) else None

    def _length(self, column: str, keyword: str, possible: tuple[float, float]) -> float | None:
        """A length that a column or an element tells, within what is possible."""
        value = self._column(column)
        if value is None and (value := self._element(keyword, column)) is not None:
            if value < 0.0:
                raise self.fault(f"{column} {value:g} is not positive", f"correct it or give the column {column}")
            value = self._in_millimetres(keyword, value, possible)
        if value is not None and not possible[0] <= value <= possible[1]:
            what = f"{column} {value:g} is impossible ({possible[0]:g} to {possible[1]:g} mm)"
            raise self.fault(what, f"correct it or give the column {column}, in mm")
        return value

    def _in_millimetres(
        self, keyword: str, value: float | None, possible: tuple[float, float] = SOURCE_DETECTOR_MM
    ) -> float | None:
        """A length that is possible only in another unit, taken in it and flagged."""
        if value is None or value >= possible[0]:
            return value
        unit = next((u for u in _UNITS if possible[0] <= value * u[1] <= possible[1]), None)
        if unit is None:
            return value
        remark = f"{keyword} {value:g} read as {unit[0]}"
        self.flags += [] if remark in self.flags else [remark]
        return value * unit[1]

    def _spacing(self) -> float | None:
        """Spacing at the detector; PixelSpacing holds in the patient, so the magnification takes it to the detector."""
        keyword = next((k for k in _SPACINGS if any(texts(self.header, k))), None)
        if keyword is None:
            return None
        written = texts(self.header, keyword)
        values = self._parsed(keyword, written)
        if values is None or len(values) > 2:
            what = f"{keyword} {quoted(written)[:_QUOTED]!r} is not a pair of numbers"
            raise self.fault(what, "give the column pixel_spacing_mm, which overrides it")
        if len(values) == 1:
            self.flags.append(f"{keyword} {values[0]:g} holds for both directions")
        rows, columns = values[0], values[-1]
        if min(rows, columns) <= 0.0:
            raise self.fault(
                f"pixel_spacing_mm {rows:g} is not positive", "correct it or give the column pixel_spacing_mm"
            )
        if abs(rows - columns) > 0.01 * max(rows, columns):
            raise self.fault(f"pixels of {rows:g} x {columns:g} mm are not square", "resample the image")
        return rows * (self._magnification() if keyword == "PixelSpacing" else 1.0)

    def _magnification(self) -> float:
        factor = self._quiet("EstimatedRadiographicMagnificationFactor")
        if factor is not None and factor >= 1.0:
            return factor
        self.flags.append("PixelSpacing taken for that at the detector")
        return 1.0
