"""The cube test (paper, section II-B, Table I) by finite elements: between plates that slide or stick."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import Equilibrium, NewtonOptions, PrescribedState
from mammoreg.materials.cube import CUBE_MM3
from mammoreg.materials.elastic import hyperelastic
from mammoreg.materials.isochoric import IsochoricLaw
from mammoreg.meshing.block import BlockMesh

Faces = Literal["sliding", "sticking"]

FIRST_STEP, LEAST_STEP, LARGEST_STEP = 0.1, 1.0 / 1024.0, 0.25
"""Shares of the compression in one load step."""
EASY_ITERATIONS = 7
_NEWTON = NewtonOptions(residual=1e-9, increment_mm=1e-6, iterations=25)


@dataclass(frozen=True)
class PressedCube:
    """A cube whose height has been taken away in part.

    Attributes:
        force_n: that presses the upper face.
        deformed: nodes (N, 3), mm, the height last.
        iterations, steps, cuts: Newton iterations, load steps that converged, and those that were halved.
        min_det_f: smallest det F at a Gauss point.
        volume_change: relative change of the whole volume.
        energy_mj: isochoric and volumetric energy.
    """

    force_n: float
    deformed: Floats
    iterations: int
    steps: int
    cuts: int
    min_det_f: float
    volume_change: float
    energy_mj: float


def press_cube(
    law: IsochoricLaw, bulk_kpa: float, compression: float, elements: int, faces: Faces, volume_mm3: float = CUBE_MM3
) -> PressedCube:
    """Compress a cube by a share of its height.

    Args:
        law: of the tissue.
        bulk_kpa: its bulk modulus.
        compression: share of the height.
        elements: a side.
        faces: upper and lower face keep their plane and slide in it, or stick to their plates; the sides are free, and
            may pass through the plates' planes.
        volume_mm3: of the cube.

    Raises:
        NotConvergedError: with the reason and how far the plates came.
    """
    mesh = _cube(elements, volume_mm3 ** (1.0 / 3.0))
    model = HyperelasticModel(mesh.points, mesh.hexes(), hyperelastic(law, bulk_kpa=bulk_kpa))
    upper = mesh.points[:, 2] > mesh.points[:, 2].max() - 1e-9
    held = _held(mesh, upper, faces)
    goal = mesh.points.copy()
    goal[upper, 2] -= compression * volume_mm3 ** (1.0 / 3.0)
    equilibrium = Equilibrium(model, held)
    state, steps, cuts = _in_steps(equilibrium, PrescribedState(model.points, np.zeros(len(model.hexes))), goal)
    return PressedCube(
        force_n=-1e-3 * float(equilibrium.reaction(state)[upper, 2].sum()),
        deformed=state.positions,
        iterations=len(equilibrium.residuals),
        steps=steps,
        cuts=cuts,
        min_det_f=float(model.determinants(state.positions).min()),
        volume_change=model.volume_change(state.positions),
        energy_mj=model.energy_mj(state.positions) + model.volumetric_energy_mj(state.pressure),
    )


def _in_steps(equilibrium: Equilibrium, state: PrescribedState, goal: Floats) -> tuple[PrescribedState, int, int]:
    """Move the held components to their goal, in steps that follow the iterations' ease."""
    origin, done, step, steps, cuts = state.positions, 0.0, FIRST_STEP, 0, 0
    while done < 1.0:
        load_factor = min(1.0, done + step)
        before = len(equilibrium.residuals)
        try:
            state = equilibrium.solve(state, origin + load_factor * (goal - origin), _NEWTON)
        except NotConvergedError as error:
            cuts, step = cuts + 1, 0.5 * step
            if step < LEAST_STEP:
                raise NotConvergedError(f"{error}; the plates came {done:.0%} of their way") from error
            continue
        done, steps = load_factor, steps + 1
        if len(equilibrium.residuals) - before <= EASY_ITERATIONS:
            step = min(2.0 * step, LARGEST_STEP)
    return state, steps, cuts


def _cube(elements: int, side: float) -> BlockMesh:
    """A cube from the origin on, k along the height turned so that Jacobians are positive."""
    axis = np.linspace(0.0, side, elements + 1)
    y, z, x = np.meshgrid(axis[::-1], axis, axis, indexing="ij")
    return BlockMesh(elements, np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))


def _held(mesh: BlockMesh, upper: NDArray[np.bool_], faces: Faces) -> NDArray[np.bool_]:
    """Held components (N, 3): the faces, and of a sliding cube three components against rigid motion."""
    held = np.zeros(mesh.points.shape, dtype=bool)
    plates = upper | (mesh.points[:, 2] < 1e-9)
    held[plates] = (True, True, True) if faces == "sticking" else (False, False, True)
    below = np.abs(mesh.points[:, 1:]).max(axis=1) < 1e-9
    side = mesh.points[below, 0]
    first, last = np.flatnonzero(below)[[side.argmin(), side.argmax()]]
    held[[first, first, last], [0, 1, 1]] = True
    return held
