"""Compression of a breast between two rigid plates, in load steps that adapt themselves."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.contact.augmented import PlateContact
from mammoreg.contact.plate import Plate
from mammoreg.contact.surface import ContactSurface, Rule
from mammoreg.errors import NotConvergedError
from mammoreg.fem.boundary import Array, BackCondition
from mammoreg.fem.equilibrium import Equilibrium, Load, NewtonOptions, Record, State
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.predictor import affine_predictor


@dataclass(frozen=True)
class CompressionOptions:
    """Numerical settings of a compression.

    Attributes:
        rule: contact points of a face.
        penalty_per_mm: contact penalty in units of the mean shear modulus per mm.
        tangential_per_mm: stiffness of friction before it slips, likewise.
        first_step: share of the way in the first load step.
        least_step: smallest share before giving up.
        easy_iterations: a step of at most this many Newton iterations doubles the next one.
        newton: when an iteration ends.
    """

    rule: Rule = "gauss3"
    penalty_per_mm: float = 2.0
    stiffest_per_mm: float = 50.0
    lip_per_mm: float = 5.0
    growth: float = 5.0
    smoothing_mm: float = 0.05
    tangential_per_mm: float = 1.0
    first_step: float = 0.5
    least_step: float = 1.0 / 128.0
    easy_iterations: int = 10
    newton: NewtonOptions = field(default_factory=NewtonOptions)


FAST = CompressionOptions(rule="nodes", newton=NewtonOptions(residual=1e-3, increment_mm=0.1, contact_mm=0.1))
"""For the search of a pose on a coarse mesh: answers to about 0.1 mm."""


@dataclass(frozen=True)
class CompressionResult:
    """A breast between the plates, plate frame.

    Attributes:
        deformed: nodes (N, 3), mm.
        pressure: element pressures (E,), kPa, positive in tension.
        height_mm: height of the lower plate's face.
        gap_mm: distance of the plates' faces.
        lower_force_n, upper_force_n: size of the force of each plate along the compression, N.
        iterations: Newton iterations of all steps, cut steps included.
        steps: load steps that converged; `cuts` those that did not.
        residuals: residual ratio of every iteration.
        energy_mj: isochoric strain energy, mJ.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        penetration_mm: deepest contact point inside a plate.
        unstable: directions in which the equilibrium is unstable; None where friction makes the matrix unsymmetric.
        state: for a warm start.
    """

    deformed: Array
    pressure: Array
    height_mm: float
    gap_mm: float
    lower_force_n: float
    upper_force_n: float
    iterations: int
    steps: int
    cuts: int
    residuals: list[float]
    energy_mj: float
    min_det_f: float
    volume_change: float
    penetration_mm: float
    unstable: int | None
    state: State


class Compression:
    """A breast, its back and the plates that close on it.

    Args:
        model: the breast in the plate frame (medial, posterior, height).
        skin_quads: faces (F, 4) that may touch the plates.
        back: condition of the back.
        edge_p_mm: posterior coordinate where the plates end; None: plates without end.
        lip_radius_mm: radius of the plates' lips there.
        friction: Coulomb coefficient of both plates.
        options: numerical settings.
    """

    def __init__(
        self,
        model: HyperelasticModel,
        skin_quads: NDArray[np.integer],
        back: BackCondition,
        edge_p_mm: float | None = None,
        lip_radius_mm: float = 5.0,
        friction: float = 0.0,
        options: CompressionOptions | None = None,
    ) -> None:
        self.model, self.back, self.edge, self.lip = model, back, edge_p_mm, lip_radius_mm
        self.options = options if options is not None else CompressionOptions()
        surface = ContactSurface(model.points, skin_quads, self.options.rule)
        mu = float(np.average(model.material.mu_kpa, weights=model.volume))
        penalty, tangential = self.options.penalty_per_mm * mu, self.options.tangential_per_mm * mu
        self.contact = PlateContact(
            surface,
            penalty,
            self.options.stiffest_per_mm * mu,
            friction,
            tangential,
            self.options.growth,
            self.options.smoothing_mm,
            self.options.lip_per_mm * mu,
        )
        held = np.zeros(model.points.shape, dtype=bool)
        held[back.nodes] = back.held
        self.equilibrium = Equilibrium(model, held, back, self.contact, back.holds_height)
        self.predictor = affine_predictor(model.points, back)
        self.low, self.high = self._touching()

    def _touching(self) -> tuple[float, float]:
        """Heights of the lower and upper plate at first touch of the undeformed body."""
        points = self.contact.surface.positions(self.model.points).reshape(-1, 3)
        lower, upper = (Plate(0.0, facing, self.edge, self.lip) for facing in (1, -1))
        return lower.first_touch(points), upper.first_touch(points)

    @property
    def uncompressed_mm(self) -> float:
        """Height of the imaged part before compression: the gap at which both plates touch."""
        return self.high - self.low

    def plates(self, gap_mm: float) -> tuple[Plate, Plate]:
        """Lower and upper plate around the middle of first touch."""
        middle = 0.5 * (self.low + self.high)
        low, high = middle - 0.5 * gap_mm, middle + 0.5 * gap_mm
        return Plate(low, 1, self.edge, self.lip), Plate(high, -1, self.edge, self.lip)

    def load(self, share: float, gap_mm: float) -> Load:
        """Plates at a gap, the back pulled by a share of its pull."""
        targets = self.model.points.copy()
        targets[self.back.nodes] += share * self.back.pull_mm
        return Load(self.plates(gap_mm), targets, targets)

    def solve(self, gap_mm: float, start: CompressionResult | None = None) -> CompressionResult:
        """Close the plates to a gap in mm, from the undeformed breast or from an earlier result of the same mesh.

        Raises:
            NotConvergedError: with the reason and how far the plates came.
        """
        record, steps, cuts = Record(), 0, 0
        done, last, state = self._start(gap_mm, start)
        first_gap, way = last, 1.0 - done
        step = min(self.options.first_step, 1.0) * way if start is None else way
        while done < 1.0:
            step = min(step, 1.0 - done)
            share = 1.0 if done + step > 1.0 - 1e-9 else done + step
            gap = first_gap + (gap_mm - first_gap) * (share - 1.0 + way) / way
            before = len(record.residuals)
            try:
                state = self._advance(state, last, gap, share, record)
            except NotConvergedError as error:
                cuts, step = cuts + 1, 0.5 * step
                if step < self.options.least_step:
                    raise NotConvergedError(_reason(error, last, gap_mm)) from error
                continue
            done, last, steps = share, gap, steps + 1
            if len(record.residuals) - before <= self.options.easy_iterations:
                step *= 2.0
        return self._result(state, gap_mm, record, steps, cuts)

    def _start(self, gap_mm: float, start: CompressionResult | None) -> tuple[float, float, State]:
        """Share of the way done, gap and state from which the plates close."""
        if start is None:
            if gap_mm >= self.uncompressed_mm:
                raise NotConvergedError(
                    f"the plates' gap of {gap_mm:.1f} mm does not compress a breast of {self.uncompressed_mm:.1f} mm"
                )
            contact = self.contact.start(self.model.points, self.plates(self.uncompressed_mm))
            undeformed = State(self.model.points, np.zeros(len(self.model.hexes)), 0.0, contact)
            return 0.0, self.uncompressed_mm, undeformed
        middle = 0.5 * (self.low + self.high)
        height = start.height_mm + 0.5 * start.gap_mm - middle
        positions = start.deformed
        if not self.back.holds_height:
            positions = positions - np.array([0.0, 0.0, height])
            height = 0.0
        return 0.0, start.gap_mm, replace(start.state, positions=positions, height=height)

    def _advance(self, state: State, last: float, gap: float, share: float, record: Record) -> State:
        """One load step; tries the affine guess and, where that turns elements inside out, none."""
        load = self.load(share, gap)
        guess = self.predictor.predict(state.positions, state.height, load.plates, gap / last)
        guess = np.where(self.equilibrium.held, load.targets, guess)
        if self.model.determinants(guess).min() < 0.2:
            guess = state.positions
        solved = self.equilibrium.solve(replace(state, positions=guess), load, self.options.newton, record)
        return self._remember(solved, load)

    def _remember(self, state: State, load: Load) -> State:
        """The state with its friction tractions and contact points as the start of the next step."""
        if state.contact is None:
            return state
        terms = self.contact.terms(state.positions, state.height, load.plates, state.contact)
        anchor = self.contact.start(state.positions, load.plates, state.height).anchor
        memory = replace(state.contact, traction=terms.traction, anchor=anchor, penalty=self.contact.penalty)
        return replace(state, contact=memory)

    def _result(self, state: State, gap_mm: float, record: Record, steps: int, cuts: int) -> CompressionResult:
        load = self.load(1.0, gap_mm)
        assert state.contact is not None
        terms = self.contact.terms(state.positions, state.height, load.plates, state.contact)
        shift = 0.0
        if not self.back.holds_height:
            nodes = self.back.nodes
            shift = -float((state.positions - self.model.points)[nodes, 2].mean())
        deformed = state.positions + np.array([0.0, 0.0, shift])
        forces = np.abs(terms.plate_force[:, 2]) * 1e-3
        return CompressionResult(
            deformed=deformed,
            pressure=state.pressure,
            height_mm=load.plates[0].height_mm + state.height + shift,
            gap_mm=gap_mm,
            lower_force_n=float(forces[0]),
            upper_force_n=float(forces[1]),
            iterations=len(record.residuals),
            steps=steps,
            cuts=cuts,
            residuals=record.residuals,
            energy_mj=self.model.energy_mj(deformed),
            min_det_f=float(self.model.determinants(deformed).min()),
            volume_change=self.model.volume_change(deformed),
            penetration_mm=float(max(0.0, -terms.distance.min())),
            unstable=record.negative_eigenvalues,
            state=state,
        )


def _reason(error: NotConvergedError, reached: float, wanted: float) -> str:
    return f"{error}; the plates came to {reached:.1f} mm of {wanted:.1f} mm with the smallest load step"
