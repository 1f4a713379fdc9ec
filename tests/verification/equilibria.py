"""Bodies whose faces are held component by component, under loads that the test states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import Equilibrium, NewtonOptions, PrescribedState

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
TIGHT = NewtonOptions(residual=1e-10, increment_mm=1e-9, iterations=30)


@dataclass(frozen=True)
class DeadForces:
    """A part of the equations (fem.parts): forces that do not follow the deformation.

    Attributes:
        nodes: their numbers (B, k).
        force: on them (B, k, 3), mN.
    """

    nodes: Indices
    force: Floats

    @property
    def dofs(self) -> Indices:
        return np.asarray((3 * self.nodes[:, :, None] + np.arange(3)).reshape(len(self.nodes), -1))

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        flat = self.force.reshape(len(self.nodes), -1)
        return -flat, np.zeros((*flat.shape, flat.shape[1]))

    def energy_mj(self, positions: Floats) -> float:
        return -1e-3 * float((self.force * positions[self.nodes]).sum())

    def renewed(self, positions: Floats) -> "DeadForces":
        return self

    def scaled(self, share: float) -> "DeadForces":
        return DeadForces(self.nodes, share * self.force)


@dataclass(frozen=True)
class Solved:
    """Nodes (N, 3), element pressures (E,) kPa, the force (N, 3) in mN that holds the nodes, Newton iterations."""

    deformed: Floats
    pressure: Floats
    reaction: Floats
    iterations: int


def solve(
    model: HyperelasticModel,
    held: NDArray[np.bool_],
    targets: Floats,
    loads: Sequence[DeadForces] = (),
    steps: int = 1,
    options: NewtonOptions = TIGHT,
    start: Solved | None = None,
) -> Solved:
    """The equilibrium under loads, with the held components (N, 3) at their targets (N, 3), in equal load steps.

    Loads grow from zero, held components come from where the start has them, else from the undeformed body.
    """
    state = PrescribedState(model.points, np.zeros(len(model.hexes)))
    if start is not None:
        state = PrescribedState(start.deformed, start.pressure)
    if held.all():
        return _imposed(model, held, targets)
    origin, iterations = state.positions, 0
    for step in range(1, steps + 1):
        share = step / steps
        equilibrium = Equilibrium(model, held, parts=[load.scaled(share) for load in loads])
        state = equilibrium.solve(state, origin + share * (targets - origin), options)
        iterations += len(equilibrium.residuals)
    return Solved(state.positions, state.pressure, equilibrium.reaction(state), iterations)


def _imposed(model: HyperelasticModel, held: NDArray[np.bool_], places: Floats) -> Solved:
    """Where nothing is free, the pressures follow from the volumes and the rest from the reactions."""
    volume = (model.weights * model.determinants(places)).sum(axis=1) / model.volume
    state = PrescribedState(places, model.material.bulk_kpa * (volume - 1.0))
    return Solved(places, state.pressure, Equilibrium(model, held).reaction(state), 0)


def face_forces(points: Floats, quads: Indices, traction: Floats) -> DeadForces:
    """Forces of a uniform traction (3,), or one per face (F, 3), kPa, on plane undeformed faces (F, 4)."""
    place, weight = np.array([-1.0, 1.0]) / 3.0**0.5, np.ones(4)
    r, s = (grid.ravel() for grid in np.meshgrid(place, place))
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    along, across = 1.0 + r[:, None] * corner[:, 0], 1.0 + s[:, None] * corner[:, 1]
    shape = 0.25 * along * across
    slopes = np.stack([0.25 * corner[:, 0] * across, 0.25 * corner[:, 1] * along])
    tangents = np.einsum("dqa,fai->dfqi", slopes, points[quads])
    area = np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=-1) * weight
    share = np.einsum("fq,qa->fa", area, shape)
    return DeadForces(quads, share[:, :, None] * np.broadcast_to(traction, (len(quads), 3))[:, None, :])


def on(points: Floats, axis: int, value: float, tolerance: float = 1e-9) -> NDArray[np.bool_]:
    """Which of the points (N, 3) lie in a plane across an axis."""
    return np.asarray(np.abs(points[:, axis] - value) < tolerance)
