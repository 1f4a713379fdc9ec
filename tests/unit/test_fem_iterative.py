"""Newton updates by GMRES and two grids against the direct solve."""

import numpy as np
import pytest

from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear import direct as linear
from mammoreg.fem.linear import saddle
from mammoreg.fem.linear.hierarchy import Hierarchy
from mammoreg.fem.linear.krylov import fgmres
from mammoreg.fem.linear.system import NewtonSystem
from mammoreg.materials.elastic import ElasticMaterial, neo_hookean
from tests.unit.breast_block import breast_block, breast_closing, sliding_back

SIZE = 12
BLOCK = breast_block(SIZE)
CENTRES = BLOCK.points[BLOCK.hexes()].mean(axis=1)
GLAND = np.where(np.linalg.norm(CENTRES - [0.0, -30.0, 0.0], axis=1) < 25.0, 100.0, 1.0)


class Squeezed:
    """The system of a breast squeezed by a fifth, with springs at its lowest nodes and an unknown behind the nodes'."""

    def __init__(self, material: ElasticMaterial, hierarchy: Hierarchy | None) -> None:
        block, rng = BLOCK, np.random.default_rng(4)
        self.model = HyperelasticModel(block.points, block.hexes(), material)
        self.positions = block.points * [1.1, 1.1, 0.8]
        total = block.points.size + 1
        back = sliding_back(block)
        held = np.zeros((len(block.points), 3), dtype=bool)
        held[back.nodes] = back.held
        lowest = np.flatnonzero(block.points[:, 2] < -40.0)
        self.group = np.column_stack([3 * lowest + 2, np.full(len(lowest), total - 1)])
        row = np.array([1.0, -1.0])
        self.spring = np.broadcast_to(500.0 * np.outer(row, row), (len(lowest), 2, 2)) + 5.0 * np.eye(2)
        self.pull = rng.standard_normal((len(lowest), 2))
        self.pressure = rng.standard_normal(SIZE**3)
        free = np.flatnonzero(np.append(~held.ravel(), True))
        self.system = NewtonSystem(self.model, [self.group], free, total, hierarchy)
        self.imposed = np.append(np.where(held, 0.01, 0.0).ravel(), 0.0)

    def increment(self, imposed: bool = False) -> tuple[np.ndarray, np.ndarray]:
        state = self.model.state(self.positions)
        internal = self.model.residual(state, self.pressure)
        blocks = [self.model.stiffness(state, self.pressure, internal.coupling), self.spring]
        given = self.imposed if imposed else None
        return self.system.increment(internal, [internal.force, self.pull], blocks, given)


@pytest.mark.parametrize(
    ("material", "most"),
    [
        (neo_hookean(10.0, 0.45), 15),
        (neo_hookean(10.0, 0.49), 15),
        (neo_hookean(10.0, 0.4999), 40),
        (neo_hookean(10.0 * GLAND, 0.49), 25),
    ],
)
def test_iterative_update_is_the_direct_one(
    material: ElasticMaterial, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    iterative, direct = Squeezed(material, Hierarchy(SIZE, 4)), Squeezed(material, None)
    rough, _ = iterative.increment()
    monkeypatch.setattr(saddle, "RESIDUAL", 1e-6)
    update, pressure = iterative.increment()
    expected, expected_pressure = direct.increment()
    assert (iterative.system.factorisations, direct.system.factorisations) == (0, 1)
    assert iterative.system.krylov[0] <= most
    assert np.abs(rough - expected).max() < 0.05 * np.abs(expected).max()
    assert np.abs(update - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(pressure - expected_pressure).max() < 1e-3 * np.abs(expected_pressure).max()


def test_imposed_increments_reach_the_iterative_update(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saddle, "RESIDUAL", 1e-9)
    material = neo_hookean(10.0, 0.49)
    update, pressure = Squeezed(material, Hierarchy(SIZE, 4)).increment(imposed=True)
    expected, expected_pressure = Squeezed(material, None).increment(imposed=True)
    np.testing.assert_allclose(update, expected, atol=1e-6)
    np.testing.assert_allclose(pressure, expected_pressure, atol=1e-5)


def test_direct_solve_steps_in_where_the_iteration_does_not_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saddle, "ITERATIONS", 2)
    material = neo_hookean(10.0, 0.49)
    broken, direct = Squeezed(material, Hierarchy(SIZE, 4)), Squeezed(material, None)
    np.testing.assert_allclose(broken.increment()[0], direct.increment()[0], atol=1e-9)
    assert broken.system.factorisations == 1
    assert broken.system.krylov == []


def test_scipy_alone_gives_the_same_iterative_update(monkeypatch: pytest.MonkeyPatch) -> None:
    material = neo_hookean(10.0, 0.49)
    expected = Squeezed(material, Hierarchy(SIZE, 4)).increment()[0]
    monkeypatch.setattr(linear, "mkl", lambda: None)
    np.testing.assert_allclose(Squeezed(material, Hierarchy(SIZE, 4)).increment()[0], expected, atol=1e-7)


def test_gmres_solves_an_indefinite_system_across_restarts_and_says_where_it_stopped() -> None:
    rng = np.random.default_rng(0)
    diagonal = np.concatenate([-np.linspace(1.0, 2.0, 20), np.linspace(1.0, 9.0, 40)])
    turn = np.linalg.qr(rng.standard_normal((60, 60)))[0]
    matrix, rhs = turn * diagonal @ turn.T, rng.standard_normal(60)
    solution, count = fgmres(lambda v: matrix @ v, lambda v: v, rhs, 1e-8, 400, restart=25)
    assert np.linalg.norm(matrix @ solution - rhs) <= 1.01e-8 * np.linalg.norm(rhs)
    assert 25 < count <= 400
    with pytest.raises(NotConvergedError, match=r"GMRES came to .* in 3 iterations"):
        fgmres(lambda v: matrix @ v, lambda v: v, rhs, 1e-8, 3)
    with pytest.raises(NotConvergedError, match="not finite"):
        fgmres(lambda v: np.nan * v, lambda v: v, rhs, 1e-8, 3)


def test_small_bodies_and_unstructured_ones_are_solved_directly() -> None:
    small = breast_closing(6).equilibrium().system
    assert small._iterative is None
