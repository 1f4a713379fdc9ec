"""Which scenarios the stability study runs: a pure function of a seed.

Five blocks: the worst corners, each also at an ordinary Poisson's ratio; pairs that differ in Poisson's ratio alone;
groups that differ in the mesh alone; scenarios that cover what is left of the pairs of levels; and those of the scan.
"""

import random
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

from mammoreg.scenes.scenario import LEVELS, SCAN, STICKING, Scenario, named, renamed

SEED = 2016
PAIRS, GROUPS, COVERING, OF_THE_SCAN = 32, 6, 96, 24
ORDINARY, WORST = 0.49, 0.4999
_CANDIDATES = 80

Levels = dict[str, Any]
LevelPair = frozenset[tuple[str, Any]]


def stability_design(seed: int = SEED) -> tuple[Scenario, ...]:
    """The scenarios of the study, the same for the same seed.

    Random numbers are those of Python's generator, whose stream is the same in every version.
    """
    chosen = list(_corners())
    choice = _Choice(seed, chosen)
    for k in range(PAIRS):
        base = choice.next({}, ("poisson",), parametric=True)
        chosen += [
            choice.kept(named(f"pair-{k + 1:02d}-{label}", base | {"poisson": nu}))
            for label, nu in (("ordinary", ORDINARY), ("worst", WORST))
        ]
    for k in range(GROUPS):
        # Without a gland the meshes are of one body; 70 % on the coarsest is no matter of trends.
        base = choice.next({"contrast": 1}, ("elements", "compression"), parametric=True)
        base["compression"] = (0.21, 0.35, 0.5)[k % 3]
        chosen += [choice.kept(named(f"mesh-{k + 1:02d}-{n}", base | {"elements": n})) for n in LEVELS["elements"]]
    for k in range(OF_THE_SCAN):
        chosen.append(choice.kept(named(f"scan-{k + 1:02d}", choice.next({"shape": SCAN}))))
    for k in range(COVERING):
        chosen.append(choice.kept(named(f"cover-{k + 1:02d}", choice.next({}, parametric=True))))
    return tuple(chosen)


def level_pairs(scenario: Scenario) -> set[LevelPair]:
    """All pairs of levels of two factors that a scenario holds."""
    held = [(factor, level) for factor, level in zip(LEVELS, scenario.levels, strict=True)]
    return {frozenset(pair) for pair in combinations(held, 2)}


def all_level_pairs() -> set[LevelPair]:
    """All pairs of levels of two factors."""
    return {
        frozenset(((one, a), (other, b)))
        for one, other in combinations(LEVELS, 2)
        for a in LEVELS[one]
        for b in LEVELS[other]
    }


def is_worst_corner(scenario: Scenario) -> bool:
    """Whether a scenario is one of the worst: nu 0.4999, 70 %, 1:1000, pendulous or flat, with friction."""
    return (
        (scenario.poisson, scenario.compression, scenario.contrast) == (WORST, 0.7, 1000)
        and scenario.shape in ("pendulous", "flat")
        and scenario.friction > 0.0
    )


def _corners() -> Iterator[Scenario]:
    """The 16 worst corners: both shapes, both frictions, all meshes, laws in turn; and each at an ordinary ratio."""
    laws, k = LEVELS["material"], 0
    for elements in LEVELS["elements"]:
        for shape in ("pendulous", "flat"):
            for friction in (0.4, STICKING):
                k += 1
                law = laws[(k - 1) % len(laws)]
                worst = Scenario(f"corner-{k:02d}-worst", law, WORST, 0.7, elements, 1000, shape, friction)
                yield worst
                yield renamed(worst, f"corner-{k:02d}-ordinary", poisson=ORDINARY)


class _Choice:
    """Greedy choice: of some random candidates that which holds most uncovered pairs and the rarest levels."""

    def __init__(self, seed: int, chosen: list[Scenario]) -> None:
        self.random = random.Random(seed)
        self.missing = all_level_pairs()
        self.counts: Counter[tuple[str, Any]] = Counter()
        self.known: set[tuple[Any, ...]] = set()
        for scenario in chosen:
            self.kept(scenario)

    def kept(self, scenario: Scenario) -> Scenario:
        """Note a scenario as chosen."""
        self.missing -= level_pairs(scenario)
        self.counts.update(zip(LEVELS, scenario.levels, strict=True))
        self.known.add(scenario.levels)
        return scenario

    def next(self, fixed: Mapping[str, Any], unseen: tuple[str, ...] = (), *, parametric: bool = False) -> Levels:
        """Levels of a new scenario.

        Args:
            fixed: levels that it must have.
            unseen: factors that do not count, because they are set afterwards.
            parametric: whether its shape is not that of the scan.
        """
        candidates = [self._candidate(fixed, parametric) for _ in range(_CANDIDATES)]
        new = [c for c in candidates if named("", c).levels not in self.known]
        return max(new, key=lambda levels: self._worth(levels, unseen))

    def _candidate(self, fixed: Mapping[str, Any], parametric: bool) -> Levels:
        levels = {factor: values[int(self.random.random() * len(values))] for factor, values in LEVELS.items()}
        if parametric:
            shapes = [shape for shape in LEVELS["shape"] if shape != SCAN]
            levels["shape"] = shapes[int(self.random.random() * len(shapes))]
        return levels | dict(fixed)

    def _worth(self, levels: Levels, unseen: tuple[str, ...]) -> float:
        pairs = level_pairs(named("", levels)) & self.missing
        seen = [pair for pair in pairs if not any(factor in unseen for factor, _ in pair)]
        common = sum(self.counts[factor, level] for factor, level in levels.items() if factor not in unseen)
        return 1000.0 * len(seen) - common
