"""Numbers in the code that shape an answer, with what their definition says of where they come from."""

import re
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1]
NUMBERS = {
    "mammoreg.pose.start": ("EDGE_QUANTILE",),
    "mammoreg.pose.alignment": ("HUBER_MM",),
    "mammoreg.pose.estimate": ("OUTLINE_SAMPLES", "OUTLINE_FLOOR_MM", "PATCH_MM", "DETERMINED_SHARE"),
    "mammoreg.pose.thickness": ("TYPICAL_SHARE", "SPREAD"),
    "mammoreg.pose.density": ("FINE_MM", "COARSE_MM", "RIM_MM"),
    "mammoreg.imaging.mr_corners": ("CORNER_FULLNESS",),
    "mammoreg.imaging.mr_chest_wall": (
        "default_tilt",
        "max_tilt",
        "upper_bend",
        "lower_bend",
        "upper_rise",
        "lower_rise",
    ),
    "mammoreg.fem.plates.options": ("slip_mm",),
}


def code_numbers() -> Iterator[tuple[str, str, str]]:
    """Place (module and name), value as written and the comment beside it, of each number in the table.

    Raises:
        ValueError: a definition is not found, or has no comment beside it.
    """
    for module, names in NUMBERS.items():
        text = SOURCE.joinpath(*module.split(".")).with_suffix(".py").read_text(encoding="utf-8")
        for name in names:
            found = re.search(rf"^ *{name}(?:: \w+)? = (.+?)  # (.+)$", text, flags=re.MULTILINE)
            if found is None:
                raise ValueError(f"{module}: no {name} with a comment that says where it comes from")
            yield f"{module}.{name}", found[1], found[2]
