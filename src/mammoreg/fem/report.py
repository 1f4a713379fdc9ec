"""What happened in a solve: iterations, balance, energies, forces, deformation, and where its time went."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

from mammoreg.arrays import Floats
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.part import Part


@dataclass(frozen=True)
class SolveReport:
    """Account of a solve.

    Attributes:
        iterations, steps, cuts: Newton iterations, load steps that converged, and steps that failed.
        residuals: ratio of unbalanced to internal forces of every iteration.
        unbalance: that ratio in the end, without damping.
        isochoric_mj, volumetric_mj: elastic energy.
        parts_mj: energy of the other parts, by kind; of loads their potential.
        plate_force_n: size of the lower and the upper plate's force along the compression; None: no plates.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        penetration_mm: deepest contact point inside a plate.
        seconds: wall time by part (assembly, contact, linear, search, other). It differs from run to run: no artefact
            may hold it.
    """

    iterations: int
    steps: int
    cuts: int
    residuals: tuple[float, ...]
    unbalance: float
    isochoric_mj: float
    volumetric_mj: float
    parts_mj: Mapping[str, float]
    plate_force_n: tuple[float, float] | None
    min_det_f: float
    volume_change: float
    penetration_mm: float
    seconds: Mapping[str, float]


class Stopwatch:
    """Wall time by part since its making; two readings of a clock for each stretch."""

    def __init__(self) -> None:
        self._begun = perf_counter()
        self._spent: dict[str, float] = {}

    @contextmanager
    def timing(self, part: str) -> Iterator[None]:
        """Add the time of a `with` block to a part."""
        begun = perf_counter()
        try:
            yield
        finally:
            self._spent[part] = self._spent.get(part, 0.0) + perf_counter() - begun

    def seconds(self) -> dict[str, float]:
        """Time by part, and the rest as `other`."""
        total = perf_counter() - self._begun
        return {**self._spent, "other": total - sum(self._spent.values())}


def solve_report(
    model: HyperelasticModel,
    positions: Floats,
    pressure: Floats,
    parts: Sequence[Part],
    residuals: Sequence[float],
    watch: Stopwatch,
    *,
    steps: int,
    cuts: int,
    unbalance: float,
    plate_force_n: tuple[float, float] | None = None,
    penetration_mm: float = 0.0,
) -> SolveReport:
    """The report of a body at nodes (N, 3), mm, and element pressures (E,), kPa, with parts at their whole load."""
    energies: dict[str, float] = {}
    for part in parts:
        name = type(part).__name__
        energies[name] = energies.get(name, 0.0) + part.energy_mj(positions)
    return SolveReport(
        iterations=len(residuals),
        steps=steps,
        cuts=cuts,
        residuals=tuple(residuals),
        unbalance=unbalance,
        isochoric_mj=model.energy_mj(positions),
        volumetric_mj=model.volumetric_energy_mj(pressure),
        parts_mj=energies,
        plate_force_n=plate_force_n,
        min_det_f=float(model.determinants(positions).min()),
        volume_change=model.volume_change(positions),
        penetration_mm=penetration_mm,
        seconds=watch.seconds(),
    )
