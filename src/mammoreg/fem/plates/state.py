"""State of a breast between plates, and what a step loads it with."""

from dataclasses import dataclass

from mammoreg.arrays import Floats
from mammoreg.contact.plate import Plate
from mammoreg.contact.soft import SoftMemory
from mammoreg.fem.parts.part import Parts


@dataclass(frozen=True)
class DampedState:
    """A deformation.

    Attributes:
        positions: nodes (N, 3), extra ones behind the body's, mm.
        pressure: element pressures (E,), kPa.
        height: the plates' extra height, mm.
        memory: of the contact.
        parts: as they were renewed here; None: as the equilibrium has them at first.
    """

    positions: Floats
    pressure: Floats
    height: float
    memory: SoftMemory
    parts: Parts | None = None


@dataclass(frozen=True)
class Load:
    """What a step loads: plates (lower, upper), and the load factor of the back's pull and of gradual parts."""

    plates: tuple[Plate, Plate]
    factor: float = 1.0
