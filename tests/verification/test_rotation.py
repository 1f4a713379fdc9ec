"""Objectivity of whole solves: a turned body under turned conditions has the turned answer."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, held_back
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.fem.prescribed.solve import PrescribedOptions, PrescribedResult, solve_prescribed
from mammoreg.materials.elastic import ElasticMaterial, hyperelastic, neo_hookean
from mammoreg.materials.exponential import Exponential
from mammoreg.materials.fibres import Fibres
from mammoreg.meshing.block import BlockMesh
from tests.unit.fe_bodies import block, distorted, rotation
from tests.verification.equilibria import TIGHT

Floats = NDArray[np.float64]
TURN = rotation((1.0, 2.0, -0.5), 1.1)
FIBRE = np.array([0.3, 1.0, -0.2])


def neo_hookean_with_fibres(turn: Floats) -> ElasticMaterial:
    return neo_hookean(np.linspace(5.0, 20.0, 64), 0.499, turn @ FIBRE, 12.0, 0.5)


def exponential_with_fibres(turn: Floats) -> ElasticMaterial:
    return hyperelastic(Exponential(4.46, 7.4), 0.499, fibres=Fibres(turn @ FIBRE, 6.0))


def bent(mesh: BlockMesh, turn: Floats, material: ElasticMaterial) -> PrescribedResult:
    """The top of a block moved and tilted, its bottom on anisotropic springs, in a frame turned as a whole."""
    points = mesh.points
    top, bottom = (np.flatnonzero(sign * points[:, 2] > 29.999) for sign in (1.0, -1.0))
    moved = points[top] @ rotation((0.2, 1.0, 0.0), 0.3).T + [5.0, -3.0, -12.0]
    spring = np.tile(turn @ np.diag([400.0, 900.0, 3000.0]) @ turn.T, (len(bottom), 1, 1))
    back = BackCondition(bottom, np.zeros((len(bottom), 3), dtype=bool), spring, turn @ np.array([1.0, 2.0, 0.5]))
    model = HyperelasticModel(points @ turn.T, mesh.hexes(), material)
    options = PrescribedOptions(first_step=0.25, newton=TIGHT)
    return solve_prescribed(model, top, moved @ turn.T, back, options=options)


@pytest.mark.parametrize("material", [neo_hookean_with_fibres, exponential_with_fibres])
def test_prescribed_body_turns(material: Callable[[Floats], ElasticMaterial]) -> None:
    mesh = distorted(4)
    plain, turned = (bent(mesh, turn, material(turn)) for turn in (np.eye(3), TURN))
    assert np.abs(plain.deformed - mesh.points).max() > 10.0
    np.testing.assert_allclose(turned.deformed, plain.deformed @ TURN.T, atol=1e-9)
    np.testing.assert_allclose(turned.pressure, plain.pressure, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(turned.reaction_n, TURN @ plain.reaction_n, rtol=1e-9, atol=1e-10)
    assert turned.energy_mj == pytest.approx(plain.energy_mj, rel=1e-9)
    assert turned.iterations == plain.iterations


def squeezed(mesh: BlockMesh, turn: Floats, friction: float) -> tuple[Floats, tuple[float, float]]:
    """A block between plates, held at nine nodes in the middle, turned about the plates' normal."""
    nodes = np.flatnonzero((np.abs(mesh.points) < [15.1, 15.1, 0.1]).all(axis=1))
    model = HyperelasticModel(mesh.points @ turn.T, mesh.hexes(), neo_hookean(10.0, 0.49))
    options = ClosingOptions(
        damping=1e-9, rests=2, tolerance_mm=1e-8, contact_factors=(), penalty_per_mm=20.0, band_mm=0.5
    )
    back = held_back(nodes, np.ones(3, dtype=bool))
    closed = Closing(model, mesh.skin_quads(), back, friction=friction, options=options, lower_mm=-21.0).close(42.0)
    return closed.deformed, closed.force_n


@pytest.mark.parametrize(("friction", "tolerance_mm"), [(0.0, 1e-9), (0.3, 1e-8)])
def test_squeezed_body_turns_about_the_plates_normal(friction: float, tolerance_mm: float) -> None:
    """Friction remembers the way there, whose steps start from guesses along the axes of the plates."""
    mesh = block(4)
    turn = rotation((0.0, 0.0, 1.0), 0.7)
    (plain, force), (turned, turned_force) = (squeezed(mesh, t, friction) for t in (np.eye(3), turn))
    np.testing.assert_allclose(turned, plain @ turn.T, atol=tolerance_mm, rtol=0.0)
    assert turned_force == pytest.approx(force, rel=max(tolerance_mm, 1e-9))
