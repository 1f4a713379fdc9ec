"""What an MR stack shows, from its header: weighting, contrast agent, and whether it is anatomy at all."""

import re

from stages.cohort.readers.mr.stacks import MrStack

_NO_ANATOMY: dict[str, tuple[frozenset[str], frozenset[str]]] = {
    "localizer": (
        frozenset({"LOCALIZER"}),
        frozenset({"localizer", "localiser", "localizador", "scout", "survey", "loc", "topogram", "calibration"}),
    ),
    "subtraction": (
        frozenset({"SUBTRACTION", "SUBTRACT", "SUBTRACTED", "SUB"}),
        frozenset(
            {"sub", "subs", "subt", "subtr", "subtraction", "subtracted", "subtrahiert", "subtracao", "subtraktion"}
        ),
    ),
    "projection (MIP)": (
        frozenset({"MIP", "MAX_IP", "MIN_IP", "MINIP", "MNIP", "PROJECTION IMAGE", "VRT", "VOLUME RENDERED", "VOLREN"}),
        frozenset({"mip", "mips", "minip", "vrt"}),
    ),
    "diffusion": (
        frozenset({"DIFFUSION", "ADC", "EADC", "TRACEW", "TRACE", "CALC_BVALUE", "ADC_MAP"}),
        frozenset({"dwi", "dwibs", "adc", "eadc", "diff", "diffusion", "trace", "tracew", "ep2d"}),
    ),
    "map computed from other volumes": (
        frozenset(
            {"PERFUSION", "TTP", "PEI", "WASH_IN", "WASH_OUT", "WIN", "WOUT", "MIPT", "T1 MAP", "T2 MAP", "B0 MAP"}
        ),
        frozenset({"ttp", "pei", "washin", "washout"}),
    ),
    "phase, real or imaginary part": (
        frozenset({"P", "PHASE", "PHASE MAP", "R", "REAL", "I", "IMAGINARY", "VELOCITY MAP", "PHASE CONTRAST M"}),
        frozenset(),
    ),
}
"""Reason not to take a stack: values of ImageType, words of the descriptions."""

_T1_WORDS = frozenset(
    [
        "vibe",
        "flash",
        "fl3d",
        "fl2d",
        "spgr",
        "fspgr",
        "fgre",
        "efgre3d",
        "thrive",
        "ethrive",
        "lava",
        "vibrant",
        "dyn",
        "dynamic",
        "dynaviews",
        "tfe",
        "t1tfe",
    ]
)
_T2_WORDS = frozenset(["stir", "tirm", "flair", "haste", "ssfse"])
_BEFORE = frozenset(
    [
        "pre",
        "precontrast",
        "nativ",
        "native",
        "unenhanced",
        "noncontrast",
        "ohne",
        "sem",
        "sans",
        "without",
        "nonenhanced",
    ]
)
_AFTER = frozenset(
    [
        "post",
        "postcontrast",
        "gd",
        "gad",
        "gado",
        "gadolinium",
        "km",
        "contrast",
        "contraste",
        "t1c",
        "enhanced",
        "delayed",
        "tardio",
    ]
)
_AFTER_SIGNS = ("+c", "c+", "+gd", "gd+", "+km")
_LEFT, _RIGHT = frozenset({"left", "lt", "links", "esquerda", "esq"}), frozenset({"right", "rt", "rechts", "direita"})
_LONG_ECHO_MS = 45.0
_T1_ECHO_MS, _T1_REPETITION_MS = 30.0, 1300.0
_STIR_MS = (80.0, 260.0)


def no_anatomy(stack: MrStack) -> str:
    """Why a stack shows no anatomy, empty where its header says nothing of the kind."""
    parts = {part for value in stack.first.kind for part in re.split(r"[^A-Z0-9]+", value)}
    values = set(stack.first.kind) | {part for part in parts if len(part) > 2}
    for reason, (kinds, words) in _NO_ANATOMY.items():
        if kinds & values or words & stack.first.words:
            return reason
    return "diffusion" if stack.first.b_value else ""


def weighting(stack: MrStack) -> str:
    """`T1`, `T2` (STIR and proton density too), or empty where the header does not tell."""
    first = stack.first
    echo, repetition, inversion = first.echo_ms, first.repetition_ms, first.inversion_ms
    # No name makes a late echo T1.
    if echo is not None and echo >= _LONG_ECHO_MS:
        return "T2"
    named = _named_weighting(stack)
    if named:
        return named
    if inversion is not None and "IR" in first.scanning and _STIR_MS[0] <= inversion <= _STIR_MS[1]:
        return "T2"
    if echo is None or repetition is None or echo > _T1_ECHO_MS:
        return ""
    return "T1" if repetition <= _T1_REPETITION_MS else "T2"


def _named_weighting(stack: MrStack) -> str:
    words, kinds = stack.first.words, set(stack.first.kind)
    t1 = bool(words & _T1_WORDS) or any(word.startswith("t1") for word in words) or "T1" in kinds
    t2 = bool(words & _T2_WORDS) or any(word.startswith("t2") for word in words)
    t2 = t2 or bool(kinds & {"T2", "T2_STAR", "STIR", "FLUID_ATTENUATED", "PROTON_DENSITY"})
    return "" if t1 == t2 else "T1" if t1 else "T2"


def contrast(stack: MrStack) -> str:
    """`before` or `after` the contrast agent, or empty where the header does not tell."""
    words = stack.first.words
    if stack.phase > 1:
        return "after"
    if words & _BEFORE and "post" not in words:
        return "before"
    if words & _AFTER or any(sign in word for word in words for sign in _AFTER_SIGNS):
        return "after"
    # The first phase of a dynamic series is taken before the agent, which its header may name all the same.
    if stack.phases > 1:
        return "before"
    return "after" if stack.first.agent else ""


def fat_and_water(stack: MrStack) -> int:
    """Rank of a Dixon picture: 0 all tissue in phase or water, 1 fat alone, 2 opposed phases with dark borders."""
    values = set(stack.first.kind) | {word.upper() for word in stack.first.words}
    if values & {"OPP_PHASE", "OUT_PHASE", "OPPOSED", "OPP", "OUTPHASE", "OP", "OUT_OF_PHASE"}:
        return 2
    return 1 if values & {"FAT", "F"} and not values & {"SAT", "SUPPRESSED", "FS", "WATER", "W"} else 0


def for_biopsy(stack: MrStack) -> bool:
    """Whether it was taken to guide a needle, perhaps with the breast between plates."""
    return bool(stack.first.words & {"biopsy", "bx", "biopsie", "biopsia", "needle", "grid"})


def reformatted(stack: MrStack) -> bool:
    """Whether it was computed from slices in another direction, or otherwise made anew."""
    return bool({"MPR", "REFORMATTED", "RESAMPLED", "CSA MPR"} & set(stack.first.kind)) or "mpr" in stack.first.words


def named_side(stack: MrStack) -> str:
    """L or R where header or descriptions name one breast, else empty."""
    left, right = bool(stack.first.words & _LEFT), bool(stack.first.words & _RIGHT)
    if stack.first.laterality in ("L", "R"):
        return stack.first.laterality
    return "" if left == right else "L" if left else "R"
