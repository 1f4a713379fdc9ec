"""Closing the plates on a digital patient in many small, damped load steps."""

from dataclasses import dataclass, field

import numpy as np

from mammoreg.contact.plate import Plate
from mammoreg.errors import NotConvergedError
from mammoreg.fem.linear import linear_solver
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.sparse import Assembler
from mammoreg.geometry import breast_to_plate
from mammoreg.materials.elastic import neo_hookean
from mammoreg.phantom.anatomy import Anatomy
from mammoreg.phantom.mechanics import Mechanics, Placement, element_moduli, wall_springs
from mammoreg.phantom.mesh import PhantomMesh
from mammoreg.phantom.shape import Array
from mammoreg.phantom.touch import SkinNodes, Touch

STEP = 1.0 / 16.0
LEAST_STEP = 1.0 / 500.0
SOFT_LAYER_KPA_PER_MM, STIFF_LAYER_KPA_PER_MM = 20.0, 60.0
HOLDS = 4
DAMPING_MN_PER_MM = 8.0
LOOSE, TIGHT = 3e-3, 1e-3


@dataclass(frozen=True)
class Pressed:
    """A breast between the plates, plate frame of the true angle.

    Attributes:
        deformed: nodes (N, 3), mm.
        height_mm: height of the lower plate's face.
        gap_mm: distance of the plates' faces.
        uncompressed_mm: that distance at first touch.
        force_n: mean size of the plates' forces along the compression.
        min_det_f: smallest det F at a Gauss point.
        iterations: Newton iterations.
    """

    deformed: Array
    height_mm: float
    gap_mm: float
    uncompressed_mm: float
    force_n: float
    min_det_f: float
    iterations: int


@dataclass(frozen=True)
class State:
    """Nodes (N, 3) in mm, element pressures (E,) in kPa and friction limits (plates, C) in kPa."""

    positions: Array
    pressure: Array
    limit: Array


@dataclass(frozen=True)
class Step:
    """What one load step prescribes: plates, share of the pull, stiffness of the layer, largest unbalance."""

    plates: tuple[Plate, Plate]
    pull: Array
    layer: float
    unbalance: float
    before: State


@dataclass
class Balance:
    """Residual (N * 3,), mN, its size relative to the forces, and what the linear system needs."""

    residual: Array
    ratio: float
    blocks: list[Array]
    volume: Array
    coupling: Array
    touch: Touch = field(repr=False)


class Press:
    """Plates around one patient."""

    def __init__(self, anatomy: Anatomy, mesh: PhantomMesh, mechanics: Mechanics, placement: Placement) -> None:
        points = breast_to_plate(mesh.points, placement.angle_deg)
        material = neo_hookean(element_moduli(anatomy, mesh, mechanics), mechanics.poisson)
        self.model = HyperelasticModel(points, mesh.hexes, material)
        self.mechanics, self.placement = mechanics, placement
        self.skin = SkinNodes.of(points, mesh.skin_quads)
        self.springs = wall_springs(points, mesh, mechanics)
        self.on_wall = mesh.back
        low, high = (self._plate(0.0, facing).first_touch(points[self.skin.nodes]) for facing in (1, -1))
        self.middle, self.uncompressed_mm = 0.5 * (low + high), high - low
        every = 3 * np.arange(len(points))[:, None] + np.arange(3)
        self.groups = [self.model.dofs, every, every[self.skin.nodes]]
        self.assembler = Assembler(self.groups, np.arange(points.size), points.size, symmetric=True)
        self.solver = linear_solver(self.assembler.indptr, self.assembler.indices, symmetric=True)
        self.iterations = 0

    def close(self) -> Pressed:
        """Close to the placement's share, then hold until the damping has nothing left to damp.

        Raises:
            NotConvergedError: the plates did not come as far as wanted.
        """
        points = self.model.points
        state = State(points, np.zeros(len(self.model.hexes)), np.zeros((2, len(self.skin.nodes))))
        done, size = 0.0, STEP
        while done < 1.0:
            share = min(1.0, done + size)
            try:
                state = self._balanced(self._step(state, share, SOFT_LAYER_KPA_PER_MM, LOOSE))
            except NotConvergedError as error:
                size *= 0.5
                if size < LEAST_STEP:
                    raise NotConvergedError(f"digital patient: {error}, {100 * done:.0f} % of the way") from error
                continue
            done, size = share, min(STEP, 1.5 * size)
        for hold in range(HOLDS):
            layer = SOFT_LAYER_KPA_PER_MM * (STIFF_LAYER_KPA_PER_MM / SOFT_LAYER_KPA_PER_MM) ** ((hold + 1) / HOLDS)
            step = self._step(state, 1.0, layer, TIGHT)
            state = self._balanced(step)
        return self._pressed(state, step)

    def _plate(self, height: float, facing: int) -> Plate:
        return Plate(height, facing, self.placement.edge_p_mm, self.mechanics.lip_radius_mm)

    def _step(self, state: State, share: float, layer: float, unbalance: float) -> Step:
        gap = (1.0 - share * self.placement.share) * self.uncompressed_mm
        plates = self._plate(self.middle - 0.5 * gap, 1), self._plate(self.middle + 0.5 * gap, -1)
        return Step(plates, np.array([0.0, -share * self.placement.pull_mm, 0.0]), layer, unbalance, state)

    def _balanced(self, step: Step) -> State:
        """Newton's method with a line search from the last step's state."""
        state = step.before
        balance = self._balance(state, step)
        for _ in range(30):
            if balance.ratio < step.unbalance:
                return State(state.positions, state.pressure, self.mechanics.friction * balance.touch.pressure)
            state, balance = self._improved(state, balance, step)
            self.iterations += 1
        raise NotConvergedError(f"no equilibrium within 30 Newton iterations (unbalance {balance.ratio:.1e})")

    def _balance(self, state: State, step: Step) -> Balance:
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        stiffness = self.model.stiffness(elements, state.pressure, internal.coupling)
        stretch, springs = self._springs(state, step)
        before = step.before.positions[self.skin.nodes]
        touch = self.skin.touch(state.positions[self.skin.nodes], before, step.plates, step.layer, state.limit)
        vectors = [internal.force, stretch, -touch.force]
        residual = self._summed(vectors)
        size = float(np.linalg.norm(self._summed([np.abs(v) for v in vectors])))
        volume = float(np.abs(internal.volume / self.model.volume).max())
        ratio = max(float(np.linalg.norm(residual)) / max(size, 1.0), volume)
        blocks = [stiffness, springs, touch.stiffness]
        return Balance(residual, ratio, blocks, internal.volume, internal.coupling, touch)

    def _springs(self, state: State, step: Step) -> tuple[Array, Array]:
        """Forces (N, 3) and stiffness (N, 3, 3) of wall and damping."""
        springs = np.tile(DAMPING_MN_PER_MM * np.eye(3), (len(state.positions), 1, 1))
        force = DAMPING_MN_PER_MM * (state.positions - step.before.positions)
        moved = state.positions[self.on_wall] - self.model.points[self.on_wall] - step.pull
        force[self.on_wall] += np.einsum("bij,bj->bi", self.springs, moved)
        springs[self.on_wall] += self.springs
        return force, springs

    def _summed(self, vectors: list[Array]) -> Array:
        index = np.concatenate([group.ravel() for group in self.groups])
        values = np.concatenate([v.ravel() for v in vectors])
        return np.asarray(np.bincount(index, values, minlength=self.model.points.size), dtype=float)

    def _improved(self, state: State, balance: Balance, step: Step) -> tuple[State, Balance]:
        """One Newton step, shortened until no element collapses and the work along it has lessened."""
        rate = self.model.bulk_per_volume
        volumetric = (rate * balance.volume)[:, None] * balance.coupling
        nothing = [np.zeros(group.shape) for group in self.groups[1:]]
        load = balance.residual + self._summed([volumetric, *nothing])
        update = self.solver.solve(self.assembler.values(balance.blocks), -load)
        pressure = rate * (balance.volume + np.einsum("ei,ei->e", balance.coupling, update[self.model.dofs]))
        motion, work, share = update.reshape(-1, 3), abs(float(load @ update)), 1.0
        share = min(1.0, 15.0 / float(np.abs(motion).max()))
        while share > 0.01:
            trial = State(state.positions + share * motion, state.pressure + share * pressure, state.limit)
            if self.model.determinants(trial.positions).min() > 0.05:
                found = self._balance(trial, step)
                left = abs(float(found.residual @ update))
                if left <= 0.9 * work or share < 0.1:
                    return trial, found
            share *= 0.5
        raise NotConvergedError("an element turns inside out")

    def _pressed(self, state: State, step: Step) -> Pressed:
        touch = self._balance(state, step).touch
        low, high = step.plates
        return Pressed(
            deformed=state.positions,
            height_mm=low.height_mm,
            gap_mm=high.height_mm - low.height_mm,
            uncompressed_mm=self.uncompressed_mm,
            force_n=float(np.abs(touch.plate_force[:, 2]).mean()) * 1e-3,
            min_det_f=float(self.model.determinants(state.positions).min()),
            iterations=self.iterations,
        )
