"""A breast at rest between plates."""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.contact.soft import SoftTerms
from mammoreg.errors import NotConvergedError
from mammoreg.fem.parts.part import parts_at
from mammoreg.fem.plates.equilibrium import DampedEquilibrium
from mammoreg.fem.plates.state import DampedState, Load
from mammoreg.fem.report import SolveReport, solve_report

LARGEST_UNBALANCE = 0.02  # of unbalanced to internal forces at rest, without damping


@dataclass(frozen=True)
class Closed:
    """A breast at rest between plates, plate frame.

    Attributes:
        deformed: nodes (N, 3), mm.
        height_mm: height of the lower plate's face.
        gap_mm: distance of the plates' faces.
        force_n: size of the lower and the upper plate's force along the compression.
        iterations, steps, cuts: Newton iterations, load steps, and steps that had to be cut.
        residuals: ratio of unbalanced to internal forces of every iteration.
        restless_mm: displacement of the last step at rest.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        penetration_mm: deepest contact point inside a plate.
        energy_mj: isochoric strain energy.
        state: to go on from.
        extra: extra nodes (M, 3), mm, or None.
        report: of the solve, where there was one.
        contact: pressures and friction at rest, where there was a solve.
    """

    deformed: Floats
    height_mm: float
    gap_mm: float
    force_n: tuple[float, float]
    iterations: int
    steps: int
    cuts: int
    residuals: list[float]
    restless_mm: float
    min_det_f: float
    volume_change: float
    penetration_mm: float
    energy_mj: float
    state: DampedState
    extra: Floats | None = None
    report: SolveReport | None = None
    contact: SoftTerms | None = None


def closed_state(
    equilibrium: DampedEquilibrium,
    state: DampedState,
    load: Load,
    gap_mm: float,
    restless_mm: float,
    steps: int,
    cuts: int,
) -> Closed:
    """The result in a state that has come to rest.

    Raises:
        NotConvergedError: its forces do not balance.
    """
    model, count = equilibrium.model, len(equilibrium.model.points)
    terms, unbalance = equilibrium.terms(state, load.plates), equilibrium.unbalance(state, load)
    if unbalance > LARGEST_UNBALANCE:
        raise NotConvergedError(f"forces at rest are out of balance by {unbalance:.1%}")
    forces = np.abs(terms.plate_force[:, 2]) * 1e-3
    force_n = (float(forces[0]), float(forces[1]))
    parts = parts_at((*equilibrium.springs, *(state.parts or ())), load.factor)
    report = solve_report(
        model,
        state.positions,
        state.pressure,
        parts,
        equilibrium.residuals,
        equilibrium.watch,
        steps=steps,
        cuts=cuts,
        unbalance=unbalance,
        plate_force_n=force_n,
        penetration_mm=terms.penetration_mm,
    )
    return Closed(
        deformed=state.positions[:count],
        height_mm=load.plates[0].height_mm + state.height,
        gap_mm=gap_mm,
        force_n=force_n,
        iterations=report.iterations,
        steps=steps,
        cuts=cuts,
        residuals=equilibrium.residuals,
        restless_mm=restless_mm,
        min_det_f=report.min_det_f,
        volume_change=report.volume_change,
        penetration_mm=terms.penetration_mm,
        energy_mj=report.isochoric_mj,
        state=state,
        extra=None if len(equilibrium.points) == count else state.positions[count:],
        report=report,
        contact=terms,
    )
