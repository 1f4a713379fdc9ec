"""One scenario of the stability study, and the levels of its factors."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

STICKING = float("inf")
"""Friction without a limit: skin that touches a plate stays where it touched."""
SCAN = "scan"
"""The shape that is not parametric: the breast of a scan that the user names."""

LEVELS: Mapping[str, tuple[Any, ...]] = {
    "material": ("neo_hookean", "exponential", "linear", "fibres", "stiffening_fibres"),
    "poisson": (0.45, 0.49, 0.495, 0.499, 0.4999),
    "compression": (0.21, 0.35, 0.5, 0.6, 0.7),
    "elements": (5, 7, 10, 14),
    "contrast": (1, 10, 100, 1000),
    "shape": ("small", "pendulous", "flat", SCAN),
    "friction": (0.0, 0.4, STICKING),
}


@dataclass(frozen=True)
class Scenario:
    """A breast between plates.

    Attributes:
        name: unique in the study.
        material: law of both tissues, see `mammoreg.scenes.tissue`.
        poisson: Poisson's ratio.
        compression: share of the uncompressed thickness that the plates take away.
        elements: hexahedra a side.
        contrast: initial shear modulus of gland over fat's.
        shape: a body of `mammoreg.scenes.bodies`, or `scan`.
        friction: Coulomb coefficient between skin and plates, or `STICKING`.
    """

    name: str
    material: str
    poisson: float
    compression: float
    elements: int
    contrast: int
    shape: str
    friction: float

    @property
    def levels(self) -> tuple[Any, ...]:
        """Its level of each factor, in the order of `LEVELS`."""
        return tuple(getattr(self, factor) for factor in LEVELS)

    def without(self, factor: str) -> tuple[Any, ...]:
        """Its levels of all factors but one."""
        return tuple(getattr(self, other) for other in LEVELS if other != factor)


def named(name: str, levels: Mapping[str, Any]) -> Scenario:
    """A scenario from its levels by factor."""
    return Scenario(name, **{field.name: levels[field.name] for field in fields(Scenario) if field.name != "name"})


def alike_but(scenarios: Iterable[Scenario], factor: str) -> list[tuple[Scenario, ...]]:
    """Groups of at least two scenarios that differ in one factor alone, each in the order of its levels."""
    groups: dict[tuple[Any, ...], list[Scenario]] = {}
    for scenario in scenarios:
        groups.setdefault(scenario.without(factor), []).append(scenario)
    order = {level: place for place, level in enumerate(LEVELS[factor])}
    return [tuple(sorted(g, key=lambda s: order[getattr(s, factor)])) for g in groups.values() if len(g) > 1]


def renamed(scenario: Scenario, name: str, **levels: Any) -> Scenario:
    """The scenario under another name, with other levels of some factors."""
    return replace(scenario, name=name, **levels)
