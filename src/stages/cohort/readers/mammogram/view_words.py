"""Side, view and modifiers of a mammogram as people, vendors and code sequences write them."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from pydicom.sr.codedict import codes
from pydicom.sr.coding import Code

from mammoreg.imaging.views import VIEWS

Side = Literal["L", "R", "B"]
"""B: both breasts in one image."""

_SIDES: Mapping[str, Side] = {
    **dict.fromkeys(("L", "LT", "LEFT", "G-A101", "7771000", "T-04030", "80248007"), "L"),
    **dict.fromkeys(("R", "RT", "RIGHT", "G-A100", "24028007", "T-04020", "73056007"), "R"),
    **dict.fromkeys(("B", "BOTH", "BILATERAL", "G-A102", "51440002", "T-04080", "63762007"), "B"),
}
_OTHER_VIEWS: Mapping[str, str] = {
    "SIO": "superolateral to inferomedial oblique",
    "ISO": "inferomedial to superolateral oblique",
    "XCC": "cranio-caudal exaggerated, to which side it does not say",
    "SPECIMEN": "a specimen, not a breast",
}
_VIEW_CODES: Mapping[str, Code] = {
    "CC": codes.CID4014.CranioCaudal,
    "MLO": codes.CID4014.MedioLateralObliqueProjection,
    "ML": codes.CID4014.MedioLateralProjection,
    "LM": codes.CID4014.LateroMedial,
    "LMO": codes.CID4014.LateroMedialOblique,
    "XCCL": codes.CID4014.CranioCaudalExaggeratedLaterally,
    "XCCM": codes.CID4014.CranioCaudalExaggeratedMedially,
    "FB": codes.CID4014.CaudoCranial,
    "SIO": codes.CID4014.SuperolateralToInferomedialOblique,
    "ISO": codes.CID4014.InferomedialToSuperolateralOblique,
    "SPECIMEN": codes.CID4014.TissueSpecimenFromBreast,
}
_OLD_VIEW_CODES: Mapping[str, str] = {"Y-X1770": "XCCL", "Y-X1771": "XCCM", "R-102CF": "XCC"}
_MODIFIER_CODES: Mapping[str, Code] = {
    "magnification": codes.CID4015.Magnification,
    "spot compression": codes.CID4015.SpotCompression,
    "cleavage": codes.CID4015.Cleavage,
    "axillary tail": codes.CID4015.AxillaryTail,
    "tangential": codes.CID4015.Tangential,
    "rolled lateral": codes.CID4015.RolledLateral,
    "rolled medial": codes.CID4015.RolledMedial,
    "rolled inferior": codes.CID4015.RolledInferior,
    "rolled superior": codes.CID4015.RolledSuperior,
    "implant displaced": codes.CID4015.ImplantDisplaced,
    "anterior compression": codes.CID4015.AnteriorCompression,
    "infra-mammary fold": codes.CID4015.InfraMammaryFold,
    "axillary tissue": codes.CID4015.AxillaryTissue,
    "nipple in profile": codes.CID4015.NippleInProfile,
}
# Words that say more than one token; longer ones first. A token in capitals stands for them.
_PHRASES = tuple(
    (re.compile(pattern), token)
    for pattern, token in (
        (r"MEDIO\W*LATERAL\W*OBLIQUE", " MLO "),
        (r"LATERO\W*MEDIAL\W*OBLIQUE", " LMO "),
        (r"SUPERO\W*LATERAL\W*TO\W*INFERO\W*MEDIAL\W*OBLIQUE", " SIO "),
        (r"INFERO\W*MEDIAL\W*TO\W*SUPERO\W*LATERAL\W*OBLIQUE", " ISO "),
        (r"MEDI(AL|O)\W*LATERAL", " ML "),
        (r"LATERO\W*MEDIAL", " LM "),
        (r"(EXAGGERATED\W*)?CRANIO\W*CAUDAL\W*(EXAGGERATED)?\W*LATERAL(LY)?", " XCCL "),
        (r"(EXAGGERATED\W*)?CRANIO\W*CAUDAL\W*(EXAGGERATED)?\W*MEDIAL(LY)?", " XCCM "),
        (r"EXAGGERATED\W*CRANIO\W*CAUDAL|CRANIO\W*CAUDAL\W*EXAGGERATED", " XCC "),
        (r"CRANIO\W*CAUDAL", " CC "),
        (r"CAUDO\W*CRANIAL(\W*FROM\W*BELOW)?|FROM\W*BELOW", " FB "),
        (r"SPOT(\W*COMPRESSION)?", " SPOT "),
        (r"MAGNIFI(ED|CATION)|\bMAG\b", " MAG "),
        (r"IMPLANT\W*DISPLACED|PUSH\W*BACK|EKLUND", " ID "),
        (r"AXILLARY\W*TAIL|\bCLEOPATRA\b", " AT "),
        (r"CLEAVAGE|VALLEY", " CV "),
        (r"TANGENTIAL", " TAN "),
        (r"ROLLED\W*(LATERAL|MEDIAL|INFERIOR|SUPERIOR)", r" R_\1 "),
        (r"ANTERIOR\W*COMPRESSION", " AC "),
        (r"NIPPLE\W*IN\W*PROFILE", " NP "),
        (r"INFRA\W*MAMMARY\W*FOLD", " IMF "),
    )
)
_MODIFIER_TOKENS: Mapping[str, str] = {
    "SPOT": "spot compression",
    "MAG": "magnification",
    "ID": "implant displaced",
    "AT": "axillary tail",
    "CV": "cleavage",
    "TAN": "tangential",
    "RL": "rolled lateral",
    "RM": "rolled medial",
    "RI": "rolled inferior",
    "RS": "rolled superior",
    "R_LATERAL": "rolled lateral",
    "R_MEDIAL": "rolled medial",
    "R_INFERIOR": "rolled inferior",
    "R_SUPERIOR": "rolled superior",
    "AC": "anterior compression",
    "NP": "nipple in profile",
    "IMF": "infra-mammary fold",
    "AX": "axillary tissue",
}
_NAMES = "|".join(sorted((*VIEWS, *_OTHER_VIEWS), key=len, reverse=True))
_SUFFIXES = "SPOT|MAG|ID|RL|RM|RI|RS|NP|AC|AX|IMF"
_TOKEN = re.compile(rf"(?P<side>[RL])?(?P<prefix>[MS]{{0,2}})(?P<view>{_NAMES})(?P<suffix>(?:{_SUFFIXES})*)")
_PREFIXES = {"M": "magnification", "S": "spot compression"}


@dataclass
class Words:
    """What a text says.

    Attributes:
        sides, views: all that it names; views of `VIEWS` and others.
        modifiers: in words.
    """

    sides: set[Side] = field(default_factory=set)
    views: set[str] = field(default_factory=set)
    modifiers: list[str] = field(default_factory=list)

    @property
    def known(self) -> bool:
        """Whether it says anything."""
        return bool(self.sides or self.views or self.modifiers)


def read_words(texts: Iterable[str]) -> Words:
    """Side, view and modifiers in texts such as `RIGHT CC`, `RCC`, `L MLO`, `MCC`, `CCID` or `cranio-caudal`."""
    joined = " ".join(texts).upper()
    for pattern, token in _PHRASES:
        joined = pattern.sub(token, joined)
    found = Words()
    for token in re.split(r"[^A-Z0-9_]+", joined):
        _read_token(token, found)
    return found


def _read_token(token: str, found: Words) -> None:
    if token in VIEWS or token in _OTHER_VIEWS:
        found.views.add(token)
    elif token in _MODIFIER_TOKENS:
        found.modifiers.append(_MODIFIER_TOKENS[token])
    elif token in _SIDES:
        found.sides.add(_SIDES[token])
    elif match := _TOKEN.fullmatch(token):
        found.views.add(match["view"])
        found.sides |= {_SIDES[match["side"]]} if match["side"] else set()
        found.modifiers += [_PREFIXES[letter] for letter in match["prefix"]]
        found.modifiers += [_MODIFIER_TOKENS[suffix] for suffix in re.findall(_SUFFIXES, match["suffix"])]


def view_of_code(value: str, scheme: str, meaning: str) -> str | None:
    """The view that a code names (SNOMED CT, or SRT and what stood for it), or its meaning; None if neither does."""
    if value in _OLD_VIEW_CODES:
        return _OLD_VIEW_CODES[value]
    if (found := _of_code(value, scheme, _VIEW_CODES)) is not None:
        return found
    views = read_words([meaning]).views
    return views.pop() if len(views) == 1 else None


def modifiers_of_code(value: str, scheme: str, meaning: str) -> list[str]:
    """The modifiers that a code names, in words; a code that is not known says what its meaning says."""
    found = _of_code(value, scheme, _MODIFIER_CODES)
    return [found] if found is not None else read_words([meaning]).modifiers


def side_of_code(value: str) -> Side | None:
    """The side that a code of the anatomic region, or of its modifier, names."""
    return _SIDES.get(value.upper())


def _of_code(value: str, scheme: str, known: Mapping[str, Code]) -> str | None:
    # Older units write SNM3 or 99SDM for SRT.
    code = Code(value, "SCT" if scheme == "SCT" or value.isdigit() else "SRT", "")
    return next((name for name, other in known.items() if code == other), None)


def in_words(view: str) -> str:
    """A view that cannot be registered, with what its name means."""
    return f"{view} ({_OTHER_VIEWS[view]})" if view in _OTHER_VIEWS else view
