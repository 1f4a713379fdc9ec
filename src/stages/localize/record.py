"""What stage `localize` leaves: predictions in every direction, written and looked up by what they are about."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume
from mammoreg.localization.lesions import LesionArea
from stages.engine.artefact import Array, Artefact, Fields, VolumeField

STRAY = "marked in the air or outside the breast"
FILLING = "the lesion fills the breast"
LARGE = "the lesion is unusually large"
"""What messages say of marks that cannot be what they are said to be."""


@dataclass(frozen=True)
class MammogramRow:
    """Where a mammogram shows what is marked in the MR volume: a row of `predictions_mammogram.csv`.

    Attributes:
        column, row: pixel of the stored image; None where nothing is seen.
        radius_mm: of the region that holds it with 95 %.
        message: why there is no place, or what speaks against the mark.
    """

    view: str
    method: str
    name: str
    column: float | None = None
    row: float | None = None
    radius_mm: float | None = None
    seen: bool = False
    message: str = ""

    @property
    def pixel(self) -> Points:
        """Place (2,) as (column, row) in the stored image, nan where nothing is seen."""
        return np.array([self.column, self.row], dtype=float)


@dataclass(frozen=True)
class MrRow:
    """Where in the undeformed MR volume what the mammograms mark lies: a row of `predictions_mr.csv`.

    Attributes:
        views: that were used, such as CC+MLO.
        x, y, z: LPS, mm; None where there is no point.
        radius_mm: of the region that holds it with 95 %.
        beam_gap_mm: distance of two views' beams.
        clock: position on the breast as on a clock's face.
        message: why there is no point, or what speaks against it.
    """

    views: str
    method: str
    name: str
    x: float | None = None
    y: float | None = None
    z: float | None = None
    radius_mm: float | None = None
    beam_gap_mm: float | None = None
    nipple_distance_mm: float | None = None
    clock: str = ""
    skin_depth_mm: float | None = None
    chest_wall_depth_mm: float | None = None
    message: str = ""

    @property
    def point(self) -> Points:
        """Place (3,), LPS mm, nan where there is no point."""
        return np.array([self.x, self.y, self.z], dtype=float)


@dataclass(frozen=True)
class CompressedRow:
    """Where a landmark lies in the compressed MR volume: a row of `predictions_compressed.csv`.

    Attributes:
        x, y, z: LPS, mm; None where there is no point.
        message: why there is none, or what speaks against the mark.
    """

    method: str
    name: str
    x: float | None = None
    y: float | None = None
    z: float | None = None
    message: str = ""

    @property
    def point(self) -> Points:
        """Place (3,), LPS mm, nan where there is no point."""
        return np.array([self.x, self.y, self.z], dtype=float)


@dataclass(frozen=True)
class AreaPrediction:
    """A lesion of the MR volume as a method shows it in a mammogram, canonical pixels."""

    view: str
    method: str
    name: str
    area: LesionArea


@dataclass(frozen=True)
class RegionPrediction:
    """A lesion of the mammograms as a method shows it in the MR volume, LPS mm.

    Attributes:
        curves: beam (N, 3) of each view in the undeformed breast.
        region: mask, None where the tubes do not meet.
    """

    method: str
    name: str
    curves: Mapping[str, Points]
    region: Volume | None


def mammogram_fields(rows: Sequence[MammogramRow], areas: Sequence[AreaPrediction], lesions: Sequence[str]) -> Fields:
    """Predictions from MR to mammogram; `lesions` are those that the MR volume marks."""
    arrays, places = {}, {}
    for found in areas:
        key = _area_key(found.view, found.method, lesions.index(found.name))
        arrays[key] = Array(found.area.mask, "1", f"{found.name}, predicted by {found.method}, canonical pixels")
        places[key] = list(found.area.first)
    values: dict[str, Any] = {
        "mammogram_rows": [asdict(row) for row in rows],
        "mammogram_area_places": places,
        "mr_lesion_names": list(lesions),
    }
    return Fields(arrays=arrays, values=values)


def mr_fields(rows: Sequence[MrRow], regions: Sequence[RegionPrediction], lesions: Sequence[str]) -> Fields:
    """Predictions from mammogram to MR; `lesions` are those that the mammograms mark."""
    arrays, volumes = {}, {}
    for found in regions:
        key = _mr_key(found.method, lesions.index(found.name))
        for view, curve in found.curves.items():
            arrays[f"{key}/curve_{view}"] = Array(curve, "mm", f"beam of {view} in the undeformed breast")
        if found.region is not None:
            meaning = "predicted lesion in the undeformed breast"
            volumes[f"{key}/region"] = VolumeField(found.region, "1", meaning)
    values: dict[str, Any] = {"mr_rows": [asdict(row) for row in rows], "mammogram_lesion_names": list(lesions)}
    return Fields(arrays=arrays, volumes=volumes, values=values)


def compressed_fields(
    rows: Sequence[CompressedRow], view: str | None = None, placing: Mapping[str, Points] | None = None
) -> Fields:
    """Predictions into the compressed volume.

    Args:
        rows: of the landmarks.
        view: whose compression that volume shows.
        placing: by method, the shift (3,), LPS mm, from where the view's pose has the deformed breast to that volume.
    """
    shifts = {method: [float(x) for x in shift] for method, shift in (placing or {}).items()}
    rows_found = [asdict(row) for row in rows]
    return Fields(values={"compressed_rows": rows_found, "compressed_view": view, "compressed_placing_mm": shifts})


def _area_key(view: str, method: str, number: int) -> str:
    """Name of the array of a projected lesion, numbered as in `mr_lesion_names`."""
    return f"mammogram/{view}/{method}/lesion{number}"


def _mr_key(method: str, number: int) -> str:
    """Group of a lesion's region and curves, numbered as in `mammogram_lesion_names`."""
    return f"mr/{method}/lesion{number}"


class Predictions:
    """The predictions of a case; of an artefact that failed what there is; of none nothing."""

    def __init__(self, localize: Artefact | None) -> None:
        self._artefact = localize
        self.mammogram_rows = [MammogramRow(**row) for row in self._given("mammogram_rows", [])]
        self.mr_rows = [MrRow(**row) for row in self._given("mr_rows", [])]
        self.compressed_rows = [CompressedRow(**row) for row in self._given("compressed_rows", [])]
        self._mammogram = {(r.view, r.method, r.name): r for r in self.mammogram_rows}
        self._mr = {(r.method, r.name): r for r in self.mr_rows}
        self._compressed = {(r.method, r.name): r for r in self.compressed_rows}

    @property
    def mr_lesions(self) -> list[str]:
        """Names of the lesions marked in the MR volume."""
        return list(self._given("mr_lesion_names", []))

    @property
    def mammogram_lesions(self) -> list[str]:
        """Names of the lesions marked in the mammograms."""
        return list(self._given("mammogram_lesion_names", []))

    def in_mammogram(self, view: str, method: str, name: str) -> MammogramRow | None:
        """Place of a lesion or landmark that the mammogram shows; None if unseen or failed."""
        row = self._mammogram.get((view, method, name))
        return row if row is not None and row.seen else None

    def area(self, view: str, method: str, name: str) -> LesionArea | None:
        """The projected lesion, canonical pixels; None where nothing of it is imaged."""
        names, places = self.mr_lesions, self._given("mammogram_area_places", {})
        key = _area_key(view, method, names.index(name)) if name in names else ""
        if key not in places:
            return None
        first_column, first_row = places[key]
        return LesionArea(self._opened.array(key, "1") != 0, (first_column, first_row))

    def in_mr(self, method: str, name: str) -> MrRow | None:
        """Place of a lesion in the MR volume; None if there is no point."""
        row = self._mr.get((method, name))
        return row if row is not None and row.x is not None else None

    def region(self, method: str, name: str) -> Volume | None:
        """The predicted region in the MR volume, LPS; None if the tubes do not meet."""
        key = f"{self._key(method, name)}/region"
        return self._opened.volume(key) if key in self._opened.volume_names() else None

    def curve(self, method: str, name: str, view: str) -> Points:
        """A view's beam in the undeformed breast (N, 3), LPS mm."""
        return self._opened.array(f"{self._key(method, name)}/curve_{view}", "mm")

    def in_compressed(self, method: str, name: str) -> CompressedRow | None:
        """Place of a landmark in the compressed volume; None if there is no point."""
        row = self._compressed.get((method, name))
        return row if row is not None and row.x is not None else None

    @property
    def compressed_view(self) -> str | None:
        """The view whose compression the second volume shows; None without one."""
        view = self._given("compressed_view", None)
        return None if view is None else str(view)

    def placing(self, method: str) -> Points | None:
        """Shift (3,), LPS mm, that brings what that view shows deformed onto the second volume."""
        shifts = self._given("compressed_placing_mm", {})
        return np.array(shifts[method]) if method in shifts else None

    def beam_gaps(self) -> dict[str, float]:
        """Largest gap of the beams to a lesion seen in two views, by method, mm."""
        gaps: dict[str, float] = {}
        for row in self.mr_rows:
            if row.beam_gap_mm is not None:
                gaps[row.method] = max(gaps.get(row.method, 0.0), row.beam_gap_mm)
        return gaps

    @property
    def _opened(self) -> Artefact:
        """The artefact, of which a row has been found."""
        if self._artefact is None:
            raise LookupError("nothing is predicted without an artefact")
        return self._artefact

    def _given(self, name: str, otherwise: Any) -> Any:
        known = self._artefact is not None and name in self._artefact.value_names()
        return self._opened.value(name) if known else otherwise

    def _key(self, method: str, name: str) -> str:
        return _mr_key(method, self.mammogram_lesions.index(name))
