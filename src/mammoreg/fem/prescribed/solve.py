"""Interior of a body whose skin is prescribed: the `updated` boundary conditions (paper, II-C)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition
from mammoreg.fem.parts.part import Part, all_nodes
from mammoreg.fem.prescribed.equilibrium import Equilibrium, NewtonOptions, PrescribedState
from mammoreg.fem.report import SolveReport, solve_report


@dataclass(frozen=True)
class PrescribedOptions:
    """Steps of the way from the start to the prescribed places.

    Attributes:
        first_step, least_step: load factor of the first step, and the smallest before giving up.
        easy_iterations: a step of at most this many Newton iterations doubles the next one.
        newton: when an iteration ends.
    """

    first_step: float = 1.0
    least_step: float = 1.0 / 64.0
    easy_iterations: int = 8
    newton: NewtonOptions = field(default_factory=NewtonOptions)


@dataclass(frozen=True)
class PrescribedResult:
    """A body with prescribed nodes, in the frame of its points.

    Attributes:
        deformed: nodes (N, 3), mm.
        pressure: element pressures (E,), kPa, positive in tension.
        iterations, steps, cuts: Newton iterations, load steps that converged, and those that were halved.
        residuals: ratio of unbalanced to internal forces, each iteration.
        energy_mj: isochoric strain energy, mJ.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        reaction_n: force (3,) that holds the prescribed nodes.
        node_reaction_n: force (N, 3) that holds each node; where it is free, what is left of balance.
        extra: extra nodes (M, 3), mm, or None.
        report: of the solve.
    """

    deformed: Floats
    pressure: Floats
    iterations: int
    steps: int
    cuts: int
    residuals: list[float]
    energy_mj: float
    min_det_f: float
    volume_change: float
    reaction_n: Floats
    node_reaction_n: Floats
    extra: Floats | None = None
    report: SolveReport | None = None


def solve_prescribed(
    model: HyperelasticModel,
    nodes: NDArray[np.integer],
    targets: Floats,
    back: BackCondition | None = None,
    start: Floats | None = None,
    pressure: Floats | None = None,
    options: PrescribedOptions | None = None,
    parts: Sequence[Part] = (),
    extra_nodes: Floats | None = None,
) -> PrescribedResult:
    """Move nodes (B,) to targets (B, 3), mm, in steps; the rest finds its equilibrium.

    Args:
        model: the body.
        nodes: prescribed in all components.
        targets: where they end.
        back: condition of back nodes that are not prescribed.
        start: nodes (N, 3) or with the extra ones (N + M, 3) from which to go, det F > 0; default the undeformed ones.
        pressure: element pressures (E,) at the start, kPa; default zero.
        options: steps.
        parts: what acts beside elements and back; gradual ones come on with the steps.
        extra_nodes: undeformed nodes (M, 3) beside the body's, mm, numbered behind them; `nodes`, `back` and `parts`
            may name them.

    Raises:
        NotConvergedError: with the reason and how far the nodes came.
    """
    options = options if options is not None else PrescribedOptions()
    points = all_nodes(model.points, extra_nodes)
    held, goal = _held(points, nodes, targets, back)
    origin = points.copy()
    if start is not None:
        origin[: len(start)] = start
    state = PrescribedState(origin, np.zeros(len(model.hexes)) if pressure is None else pressure)
    equilibrium = Equilibrium(model, held, back, parts, extra_nodes)
    done, step, steps, cuts = 0.0, options.first_step, 0, 0
    while done < 1.0:
        load_factor = min(1.0, done + step)
        before = len(equilibrium.residuals)
        try:
            state = equilibrium.solve(state, origin + load_factor * (goal - origin), options.newton, load_factor)
        except NotConvergedError as error:
            cuts, step = cuts + 1, 0.5 * step
            if step < options.least_step:
                raise NotConvergedError(f"{error}; the prescribed nodes came {done:.0%} of their way") from error
            continue
        done, steps = load_factor, steps + 1
        if len(equilibrium.residuals) - before <= options.easy_iterations:
            step *= 2.0
    return _result(equilibrium, state, nodes, steps, cuts)


def _result(
    equilibrium: Equilibrium, state: PrescribedState, nodes: NDArray[np.integer], steps: int, cuts: int
) -> PrescribedResult:
    """The result in a state, and its report."""
    model, count = equilibrium.model, len(equilibrium.model.points)
    report = solve_report(
        model,
        state.positions,
        state.pressure,
        equilibrium.parts,
        equilibrium.residuals,
        equilibrium.watch,
        steps=steps,
        cuts=cuts,
        unbalance=equilibrium.unbalance(state),
    )
    reaction = 1e-3 * equilibrium.reaction(state)
    return PrescribedResult(
        deformed=state.positions[:count],
        pressure=state.pressure,
        iterations=report.iterations,
        steps=steps,
        cuts=cuts,
        residuals=equilibrium.residuals,
        energy_mj=report.isochoric_mj,
        min_det_f=report.min_det_f,
        volume_change=report.volume_change,
        reaction_n=reaction[nodes].sum(axis=0),
        node_reaction_n=reaction[:count],
        extra=None if len(state.positions) == count else state.positions[count:],
        report=report,
    )


def _held(
    points: Floats, nodes: NDArray[np.integer], targets: Floats, back: BackCondition | None
) -> tuple[NDArray[np.bool_], Floats]:
    """Held components (N, 3) and where they end (N, 3)."""
    held = np.zeros(points.shape, dtype=bool)
    goal = points.copy()
    if back is not None:
        held[back.nodes] = back.held
        goal[back.nodes] += back.pull_mm
    held[nodes] = True
    goal[nodes] = targets
    return held, goal
