"""Closing the plates on a digital patient in many small, damped load steps."""

from dataclasses import dataclass, field, replace

import numpy as np

from mammoreg.contact.plate import Plate
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.direct import linear_solver
from mammoreg.fem.linear.sparse import Assembler
from mammoreg.geometry import breast_to_plate
from mammoreg.phantom.anatomy import Anatomy
from mammoreg.phantom.barrier import barrier_force, barrier_stiffness
from mammoreg.phantom.mechanics import Mechanics, Placement, breast_material, wall_springs
from mammoreg.phantom.mesh import PhantomMesh
from mammoreg.phantom.shape import Array
from mammoreg.phantom.touch import Grip, SkinNodes, Touch

STEP, LEAST_STEP = 1.0 / 16.0, 1.0 / 2000.0
HARDENING = 0.25
"""Share of the closing's load steps that follow it, in which the plates' soft surface hardens."""
SOFT_LAYER_KPA_PER_MM, STIFF_LAYER_KPA_PER_MM = 20.0, 160.0
DAMPING_MN_PER_MM, MOST_DAMPING_MN_PER_MM = 4.0, 4000.0
LOOSE, TIGHT = 3e-3, 1e-3
HOLDS, SETTLED_MM = 12, 0.1
ITERATIONS = 20
LEAST_DET = 0.03
BARRIER_RATIO = 2.0
"""Barrier against collapsing Gauss points over the shear modulus."""


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
        penetration_mm: deepest place of a skin node in a plate.
        volume_change: of the whole breast, relative.
        iterations: Newton iterations.
    """

    deformed: Array
    height_mm: float
    gap_mm: float
    uncompressed_mm: float
    force_n: float
    min_det_f: float
    penetration_mm: float
    volume_change: float
    iterations: int


@dataclass(frozen=True)
class State:
    """Nodes (N, 3) in mm, element pressures (E,) in kPa and friction's memory."""

    positions: Array
    pressure: Array
    grip: Grip


@dataclass(frozen=True)
class Step:
    """What one load step prescribes.

    Attributes:
        plates: lower and upper.
        pull: motion (3,) of the wall springs' anchors, mm.
        layer: stiffness of the plates' surface, kPa/mm.
        damping: of each node's motion since the last step, mN/mm.
        unbalance: largest unbalanced force relative to all forces.
        before: nodes (N, 3) at the end of the last step, mm.
    """

    plates: tuple[Plate, Plate]
    pull: Array
    layer: float
    damping: float
    unbalance: float
    before: Array


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
        self.model = HyperelasticModel(
            points, mesh.hexes, breast_material(anatomy, mesh, mechanics, placement.angle_deg)
        )
        self.barrier = BARRIER_RATIO * np.asarray(self.model.material.mu_kpa)
        self.mechanics, self.placement = mechanics, placement
        self.skin = SkinNodes.of(points, mesh.skin_quads)
        self.springs = wall_springs(points, mesh, mechanics)
        self.on_wall = mesh.back
        low, high = (self._plate(0.0, facing).first_touch(points[self.skin.nodes]) for facing in (1, -1))
        self.middle, self.uncompressed_mm = 0.5 * (low + high), high - low
        nipple = breast_to_plate(anatomy.shape.nipple, placement.angle_deg)[2]
        self.lift = placement.lift * (float(nipple) - self.middle)
        every = 3 * np.arange(len(points))[:, None] + np.arange(3)
        self.groups = [self.model.dofs, every, every[self.skin.nodes]]
        self.assembler = Assembler(self.groups, np.arange(points.size), points.size, symmetric=True)
        self.solver = linear_solver(self.assembler.indptr, self.assembler.indices, symmetric=True)
        self.iterations = 0

    def close(self) -> Pressed:
        """Close to the placement's share, harden the plates, then hold until nothing moves any more.

        A load step that fails is halved and damped more; each that succeeds lets both recover.

        Raises:
            NotConvergedError: the plates did not come as far as wanted.
        """
        points = self.model.points
        state = State(points, np.zeros(len(self.model.hexes)), Grip.none(points[self.skin.nodes]))
        done, size, damping, speed = 0.0, STEP, DAMPING_MN_PER_MM, np.zeros_like(points)
        while done < 1.0 + HARDENING:
            advance = min(size, 1.0 + HARDENING - done, max(1.0 - done, 0.0) or size)
            try:
                found = self._balanced(state, self._step(state, done + advance, damping, LOOSE), advance * speed)
            except NotConvergedError as error:
                size, damping, speed = 0.5 * advance, min(4.0 * damping, MOST_DAMPING_MN_PER_MM), 0.0 * speed
                if size < LEAST_STEP:
                    raise NotConvergedError(f"digital patient: {error}, {100 * done:.0f} % of the way") from error
                continue
            speed = (found.positions - state.positions) / advance
            state, done = found, done + advance
            size, damping = min(STEP, 1.5 * size), max(0.5 * damping, DAMPING_MN_PER_MM)
        return self._pressed(*self._settled(state, damping))

    def _settled(self, state: State, damping: float) -> tuple[State, Step]:
        """Hold the plates until the largest motion of a hold is small."""
        moved = np.inf
        for _ in range(HOLDS):
            step = self._step(state, 1.0 + HARDENING, damping, TIGHT)
            try:
                found = self._balanced(state, step, np.zeros_like(state.positions))
            except NotConvergedError as error:
                if damping >= MOST_DAMPING_MN_PER_MM:
                    raise NotConvergedError(f"digital patient: {error}, between the closed plates") from error
                damping *= 4.0
                continue
            moved = float(np.abs(found.positions - state.positions).max())
            state = found
            if moved < SETTLED_MM and damping <= DAMPING_MN_PER_MM:
                break
            damping = max(0.5 * damping, DAMPING_MN_PER_MM)
        return state, step

    def _plate(self, height: float, facing: int) -> Plate:
        return Plate(height, facing, self.placement.edge_p_mm, self.mechanics.lip_radius_mm)

    def _step(self, state: State, done: float, damping: float, unbalance: float) -> Step:
        share, hard = min(done, 1.0), max(done - 1.0, 0.0) / HARDENING
        half = 0.5 * (1.0 - share * self.placement.share) * self.uncompressed_mm
        middle = self.middle + share * self.lift
        plates = self._plate(middle - half, 1), self._plate(middle + half, -1)
        layer = SOFT_LAYER_KPA_PER_MM * (STIFF_LAYER_KPA_PER_MM / SOFT_LAYER_KPA_PER_MM) ** hard
        pull = np.array([0.0, -share * self.placement.pull_mm, 0.0])
        return Step(plates, pull, layer, damping, unbalance, state.positions)

    def _balanced(self, state: State, step: Step, motion: Array) -> State:
        """Newton's method with a line search from the last step's state moved on by a guess (N, 3), mm."""
        state = self._moved_on(state, motion)
        balance = self._balance(state, step)
        for _ in range(ITERATIONS):
            if balance.ratio < step.unbalance:
                places = state.positions[self.skin.nodes]
                return replace(state, grip=state.grip.renewed(balance.touch.pressure, places, self.mechanics.friction))
            state, balance = self._improved(state, balance, step)
            self.iterations += 1
        raise NotConvergedError(f"no equilibrium within {ITERATIONS} Newton iterations (unbalance {balance.ratio:.1e})")

    def _moved_on(self, state: State, motion: Array) -> State:
        """The state moved on, unless that harms an element."""
        trial = replace(state, positions=state.positions + motion)
        least = self.model.determinants(state.positions).min()
        return trial if self.model.determinants(trial.positions).min() > 0.8 * least else state

    def _balance(self, state: State, step: Step) -> Balance:
        elements = self.model.state(state.positions)
        internal = self.model.residual(elements, state.pressure)
        stiffness = self.model.stiffness(elements, state.pressure, internal.coupling)
        stiffness += barrier_stiffness(elements, self.model.weights, self.barrier)
        force = internal.force + barrier_force(elements, self.model.weights, self.barrier)
        stretch, springs = self._springs(state, step)
        touch = self.skin.touch(state.positions[self.skin.nodes], state.grip, step.plates, step.layer)
        vectors = [force, stretch, -touch.force]
        residual = self._summed(vectors)
        size = float(np.linalg.norm(self._summed([np.abs(v) for v in vectors])))
        volume = float(np.abs(internal.volume / self.model.volume).max())
        ratio = max(float(np.linalg.norm(residual)) / max(size, 1.0), volume)
        blocks = [stiffness, springs, touch.stiffness]
        return Balance(residual, ratio, blocks, internal.volume, internal.coupling, touch)

    def _springs(self, state: State, step: Step) -> tuple[Array, Array]:
        """Forces (N, 3) and stiffness (N, 3, 3) of wall and damping."""
        springs = np.tile(step.damping * np.eye(3), (len(state.positions), 1, 1))
        force = step.damping * (state.positions - step.before)
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
        motion, work = update.reshape(-1, 3), abs(float(load @ update))
        share = min(1.0, 15.0 / float(np.abs(motion).max()))
        while share > 0.01:
            trial = State(state.positions + share * motion, state.pressure + share * pressure, state.grip)
            if self.model.determinants(trial.positions).min() > LEAST_DET:
                found = self._balance(trial, step)
                left = abs(float(found.residual @ update))
                if left <= 0.9 * work or share < 0.1:
                    return trial, found
            share *= 0.5
        raise NotConvergedError("an element turns inside out")

    def _pressed(self, state: State, step: Step) -> Pressed:
        places = state.positions[self.skin.nodes]
        touch = self.skin.touch(places, state.grip, step.plates, step.layer)
        low, high = step.plates
        return Pressed(
            deformed=state.positions,
            height_mm=low.height_mm,
            gap_mm=high.height_mm - low.height_mm,
            uncompressed_mm=self.uncompressed_mm,
            force_n=float(np.abs(touch.plate_force[:, 2]).mean()) * 1e-3,
            min_det_f=float(self.model.determinants(state.positions).min()),
            penetration_mm=-min(0.0, *(float(plate.gap(places).distance.min()) for plate in step.plates)),
            volume_change=self.model.volume_change(state.positions),
            iterations=self.iterations,
        )
