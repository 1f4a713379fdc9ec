"""Values of a DICOM header as they were written: nothing that a vendor or an anonymiser writes raises here."""

import re
import struct
from dataclasses import dataclass
from functools import cache

from pydicom.datadict import dictionary_VR
from pydicom.dataelem import RawDataElement
from pydicom.dataset import Dataset
from pydicom.multival import MultiValue
from pydicom.tag import BaseTag, Tag

_BINARY = {"US": "H", "SS": "h", "UL": "I", "SL": "i", "FL": "f", "FD": "d"}
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d*,\d{3}")


@dataclass(frozen=True)
class Number:
    """A number as read.

    Attributes:
        value: finite.
        comma: whether it was written with a decimal comma.
    """

    value: float
    comma: bool = False


@cache
def tag_of(keyword: str) -> BaseTag:
    """The tag of a keyword; looking it up takes longer than reading a value."""
    return Tag(keyword)


def texts(header: Dataset, keyword: str) -> tuple[str, ...]:
    """The values of an element as texts without blanks around them, empty ones at the end left out."""
    try:
        element = header.get_item(tag_of(keyword))
    except (KeyError, ValueError):
        return ()
    if element is None:
        return ()
    value = element.value
    if isinstance(element, RawDataElement) and isinstance(value, bytes):
        found = _of_bytes(value, element.VR or dictionary_VR(element.tag), element.is_little_endian)
    elif isinstance(value, (list, tuple, MultiValue)):
        found = [str(part) for part in value]
    else:
        found = [] if value is None else str(value).split("\\")
    found = [part.strip(" \0\t\r\n") for part in found]
    while found and not found[-1]:
        found.pop()
    return tuple(found)


def _of_bytes(value: bytes, vr: str, little: bool) -> list[str]:
    if vr in _BINARY:
        code = _BINARY[vr]
        count = len(value) // struct.calcsize(code)
        order = "<" if little else ">"
        return [str(v) for v in struct.unpack(f"{order}{count}{code}", value[: count * struct.calcsize(code)])]
    return value.decode("utf-8", errors="replace").split("\\")


def text(header: Dataset, keyword: str) -> str | None:
    """The values of an element as one upper-case text, as a person would write it; None where it is empty."""
    return quoted(texts(header, keyword)).upper() or None


def quoted(values: tuple[str, ...]) -> str:
    """Several values as a person would write them."""
    return ", ".join(value for value in values if value)


def items(header: Dataset, keyword: str) -> list[Dataset]:
    """The items of a sequence; none where it is missing or damaged."""
    try:
        sequence = header.get(keyword)
        return [item for item in sequence if isinstance(item, Dataset)] if sequence else []
    except Exception:  # pydicom raises many kinds for a damaged sequence, which tells nothing
        return []


def number(written: str) -> Number | None:
    """A finite number, also with a decimal comma where this cannot part thousands; None for anything else."""
    written = written.strip()
    comma = bool(_DECIMAL_COMMA.fullmatch(written)) and not _THOUSANDS.fullmatch(written)
    try:
        value = float(written.replace(",", ".") if comma else written)
    except ValueError:
        return None
    return Number(value, comma) if abs(value) < float("inf") else None
