"""Predictions of `localize`, looked up by what they are about."""

from collections.abc import Mapping
from typing import Any

from mammoreg.geometry import Volume
from mammoreg.geometry.frames import Points
from mammoreg.localization.lesions import LesionArea
from stages.engine.artefact import Artefact
from stages.localize.to_mammogram import area_key
from stages.localize.to_mr import mr_key
from stages.marks import read_area

Row = dict[str, Any]


class Predictions:
    """The contents of a case's `localize` artefact; of a failed one what there is; of none nothing."""

    def __init__(self, localize: Artefact | None) -> None:
        self._artefact = localize
        self._mammogram = {(r["view"], r["method"], r["name"]): r for r in self._value("mammogram_rows", [])}
        self._mr = {(r["method"], r["name"]): r for r in self._value("mr_rows", [])}
        self._compressed = {(r["method"], r["name"]): r for r in self._value("compressed_rows", [])}

    def in_mammogram(self, view: str, method: str, name: str) -> Row | None:
        """Row of a lesion or landmark that the mammogram shows; None if unseen or failed."""
        row = self._mammogram.get((view, method, name))
        return row if row is not None and row["seen"] else None

    def area(self, view: str, method: str, name: str) -> LesionArea | None:
        """The projected lesion, canonical pixels; None where nothing of it is imaged."""
        names: list[str] = self._value("mr_lesion_names", [])
        places: Mapping[str, list[int]] = self._value("mammogram_area_places", {})
        key = area_key(view, method, names.index(name)) if name in names else ""
        return read_area(self._opened, key, places[key]) if key in places else None

    def in_mr(self, method: str, name: str) -> Row | None:
        """Row of a lesion in the MR volume; None if there is no point."""
        row = self._mr.get((method, name))
        return row if row is not None and row["x"] is not None else None

    def region(self, method: str, name: str) -> Volume | None:
        """The predicted region in the MR volume, LPS; None if the tubes do not meet."""
        key = self._mr_key(method, name)
        return self._opened.volume(f"{key}/region") if f"{key}/region" in self._opened.volume_names() else None

    def curve(self, method: str, name: str, view: str) -> Points:
        """A view's beam in the undeformed breast (N, 3), LPS mm."""
        return self._opened.array(f"{self._mr_key(method, name)}/curve_{view}", "mm")

    def in_compressed(self, method: str, name: str) -> Row | None:
        """Row of a landmark in the compressed volume; None if there is no point."""
        row = self._compressed.get((method, name))
        return row if row is not None and row["x"] is not None else None

    def beam_gaps(self) -> dict[str, float]:
        """Largest gap of the beams to a lesion seen in two views, by method, mm."""
        gaps: dict[str, float] = {}
        for (method, _), row in self._mr.items():
            if row["beam_gap_mm"] is not None:
                gaps[method] = max(gaps.get(method, 0.0), row["beam_gap_mm"])
        return gaps

    @property
    def _opened(self) -> Artefact:
        """The artefact, of which a row has been found."""
        if self._artefact is None:
            raise LookupError("nothing is predicted without an artefact")
        return self._artefact

    def _mr_key(self, method: str, name: str) -> str:
        return mr_key(method, self._value("mammogram_lesion_names", []).index(name))

    def _value(self, name: str, default: Any) -> Any:
        known = self._artefact is not None and name in self._artefact.value_names()
        return self._opened.value(name) if known else default
