"""What a DICOM header says of a mammogram's side and view, wherever and however it says it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import get_args

from pydicom.dataset import Dataset

from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.views import VIEWS, View
from stages.cohort.readers.header_values import items, number, quoted, text, texts
from stages.cohort.readers.mammogram.view_words import (
    Side,
    in_words,
    modifiers_of_code,
    read_words,
    side_of_code,
    view_of_code,
)

LARGEST_CONTACT_MAGNIFICATION = 1.25
"""A breast on the support is magnified less, a magnification stand does it by 1.4 to 2 (chosen)."""
_REFUSED = {
    "magnification": "a magnification view",
    "spot compression": "a spot compression view",
    "cleavage": "a cleavage view, which shows both breasts",
    "axillary tail": "a view of the axillary tail",
    "tangential": "a tangential view",
    "rolled lateral": "a rolled view",
    "rolled medial": "a rolled view",
    "rolled inferior": "a rolled view",
    "rolled superior": "a rolled view",
    "implant displaced": "a view with the implant displaced",
}
_NOTED = {
    "anterior compression": "anterior compression: the posterior breast is not as thin as the plates are apart",
    "infra-mammary fold": "view of the infra-mammary fold",
}
_EXAGGERATED = {"XCC": {"XCCL", "XCCM"}}
IMPLANT = "breast implant, which the model does not know: do not trust"
PARTIAL = "partial view: the image shows a part of the breast only"


@dataclass(frozen=True)
class Said:
    """What one element says.

    Attributes:
        element: its keyword.
        value: as a person would write it.
        names: sides, or views, of which it may mean any.
    """

    element: str
    value: str
    names: frozenset[str]


@dataclass(frozen=True)
class HeaderView:
    """Side and view by the header.

    Attributes:
        sides, views: what each element says, the most specific one first.
        refused: why this image cannot be registered, in words, each once.
        flags: what a reader must know of it.
    """

    sides: tuple[Said, ...]
    views: tuple[Said, ...]
    refused: tuple[str, ...]
    flags: tuple[str, ...]

    @property
    def side(self) -> Laterality | None:
        """The breast, where all elements that speak of it agree."""
        found = self._agreed(self.sides)
        return next((side for side in get_args(Laterality) if found == {side}), None)

    @property
    def view(self) -> View | None:
        """The view, where all elements that speak of it agree and it can be registered."""
        found = self._agreed(self.views)
        return next((view for view in VIEWS if found == {view}), None)

    @staticmethod
    def _agreed(said: tuple[Said, ...]) -> set[str]:
        if not said:
            return set()
        return set(frozenset.intersection(*(one.names for one in said)))


def side_and_view(header: Dataset) -> HeaderView:
    """Side, view and what is particular of it, by ImageLaterality, ViewPosition, ViewCodeSequence and their kin."""
    words = {keyword: read_words(texts(header, keyword)) for keyword in ("ViewPosition", "PatientOrientation")}
    if is_direction_pair(texts(header, "PatientOrientation")):
        del words["PatientOrientation"]
    codes = items(header, "ViewCodeSequence")
    modifiers = [m for found in words.values() for m in found.modifiers]
    for item in (*codes, header):
        for code in items(item, "ViewModifierCodeSequence"):
            modifiers += modifiers_of_code(*_code(code))
    views = [_said_view(k, quoted(texts(header, k)), found.views) for k, found in words.items() if found.views]
    coded = [(view, text(code, "CodeMeaning") or "") for code in codes if (view := view_of_code(*_code(code)))]
    views += [_said_view("ViewCodeSequence", view, {view}) for view, _ in coded]
    sides = [*_sides(header), *(_side(k, header, found.sides) for k, found in words.items() if found.sides)]
    return HeaderView(
        tuple(sides),
        tuple(views),
        tuple(dict.fromkeys([*unregistrable(modifiers), *_magnified(header)])),
        tuple(dict.fromkeys([*(_NOTED[m] for m in modifiers if m in _NOTED), *_flags(header), *_unread(header)])),
    )


def unregistrable(modifiers: Iterable[str]) -> list[str]:
    """What these modifiers make of a view, for those with which it cannot be registered."""
    return [_REFUSED[modifier] for modifier in modifiers if modifier in _REFUSED]


def registrable_view(name: object) -> str:
    """The name of a view that can be registered.

    Raises:
        ValueError: it cannot, which is said where the name tells why, or there is no such view.
    """
    found = str(name).upper()
    if found in VIEWS:
        return found
    reasons = unregistrable(read_words([found]).modifiers)
    what = f"{' and '.join(reasons)} cannot be registered" if reasons else "no such view"
    raise ValueError(f"{what}; known are {', '.join(VIEWS)}")


def _said_view(keyword: str, value: str, names: set[str]) -> Said:
    meant = frozenset().union(*(_EXAGGERATED.get(name, {name}) for name in names))
    return Said(keyword, in_words(value), meant)


def _side(keyword: str, header: Dataset, names: set[Side]) -> Said:
    return Said(keyword, quoted(texts(header, keyword)), frozenset(names))


def _sides(header: Dataset) -> Iterator[Said]:
    """The elements that name a side; the series' one only where the image has none, for it goes stale."""
    named = False
    for keyword in ("ImageLaterality", "FrameLaterality", "Laterality"):
        sides = read_words(texts(header, keyword)).sides
        if sides and not (named and keyword == "Laterality"):
            named = True
            yield _side(keyword, header, sides)
    for region in items(header, "AnatomicRegionSequence"):
        for code in (region, *items(region, "AnatomicRegionModifierSequence")):
            if side := side_of_code(_code(code)[0]):
                yield Said("AnatomicRegionSequence", side, frozenset({side}))


def _code(item: Dataset) -> tuple[str, str, str]:
    value, scheme, meaning = (
        quoted(texts(item, keyword)) for keyword in ("CodeValue", "CodingSchemeDesignator", "CodeMeaning")
    )
    return value, scheme, meaning


def is_direction_pair(values: tuple[str, ...]) -> bool:
    """Whether PatientOrientation holds two directions, and not what some write there instead."""
    return len(values) == 2 and all(value and set(value.upper()) <= set("APRLHF") for value in values)


def _magnified(header: Dataset) -> list[str]:
    written = texts(header, "EstimatedRadiographicMagnificationFactor")
    factor = number(written[0]) if written else None
    if factor is None or factor.value <= LARGEST_CONTACT_MAGNIFICATION:
        return []
    return [f"a magnification view (EstimatedRadiographicMagnificationFactor {factor.value:g})"]


def _flags(header: Dataset) -> list[str]:
    answers = {"BreastImplantPresent": IMPLANT, "PartialView": PARTIAL}
    found = [flag for keyword, flag in answers.items() if text(header, keyword) in ("YES", "Y")]
    paddle = {"spot compression", "magnification"} & set(read_words(texts(header, "PaddleDescription")).modifiers)
    return found + [f"taken with a paddle for {what}" for what in sorted(paddle)]


def _unread(header: Dataset) -> list[str]:
    """What stands for a side or a view but says none: the table's is taken."""
    found = []
    for keyword in ("ImageLaterality", "ViewPosition"):
        values = texts(header, keyword)
        if values and not read_words(values).known and text(header, keyword) not in ("U", "UNKNOWN", "UNPAIRED"):
            found.append(f"{keyword} is not understood, the table's is taken")
    return found
