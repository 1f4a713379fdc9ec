"""Parts of an equilibrium: forces from energies, nodes of their own, degrees of freedom that change."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.system import node_dofs
from mammoreg.fem.parts.back import back_condition, held_back
from mammoreg.fem.parts.gravity import gravity
from mammoreg.fem.parts.part import BackSprings, Part, all_nodes, back_springs, parts_at
from mammoreg.fem.parts.plane_ties import PlaneTies
from mammoreg.fem.parts.point_ties import point_ties
from mammoreg.fem.plates.closing import Closing
from mammoreg.fem.plates.equilibrium import DampedEquilibrium
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block

Floats = NDArray[np.float64]
MESH = block(3)
MODEL = HyperelasticModel(MESH.points, MESH.hexes(), neo_hookean(10.0, 0.49))


@dataclass(frozen=True)
class Pair:
    """Springs between nodes and partners; after a step each takes the partner of its neighbour if told."""

    nodes: NDArray[np.int64]
    partners: NDArray[np.int64]
    wanders: bool = False
    stiffness: float = 50.0

    @property
    def dofs(self) -> NDArray[np.int64]:
        return node_dofs(np.column_stack([self.nodes, self.partners]))

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        pull = self.stiffness * (positions[self.nodes] - positions[self.partners])
        block = self.stiffness * np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(3))
        return np.hstack([pull, -pull]), np.tile(block, (len(pull), 1, 1))

    def energy_mj(self, positions: Floats) -> float:
        return 0.5e-3 * self.stiffness * float(((positions[self.nodes] - positions[self.partners]) ** 2).sum())

    def renewed(self, _positions: Floats) -> "Pair":
        return Pair(self.nodes, np.roll(self.partners, 1), True, self.stiffness) if self.wanders else self


def _parts() -> dict[str, Part]:
    quads = MESH.skin_quads()[::5]
    rng = np.random.default_rng(3)
    shape = rng.dirichlet(np.ones(4), len(quads))
    normal = rng.normal(size=(len(quads), 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    back = back_condition("springs", MESH.points, MESH.back_quads(), pull_mm=np.array([1.0, -2.0, 0.5]))
    stiffness = rng.uniform(1.0, 9.0, len(quads))
    return {
        "springs": back_springs(back, MESH.points)[0],
        "planes": PlaneTies(quads, shape, normal, rng.normal(size=len(quads)), stiffness),
        "points": point_ties(MESH.points, quads, shape, rng.normal(size=(len(quads), 3)), stiffness),
        "gravity": gravity(MODEL, 1000.0, np.array([0.3, 0.0, -1.0])),
    }


@pytest.mark.parametrize("name", ["springs", "planes", "points", "gravity"])
@pytest.mark.parametrize("share", [0.4, 1.0])
def test_forces_are_the_gradient_of_the_energy_and_stiffness_their_derivative(name: str, share: float) -> None:
    (part,) = parts_at([_parts()[name]], share)
    rng = np.random.default_rng(5)
    positions = MESH.points + rng.normal(size=MESH.points.shape)
    motion, step = rng.normal(size=positions.shape), 1e-3
    residual, stiffness = part.terms(positions)
    work = float(np.sum(residual * motion.ravel()[part.dofs]))
    change = part.energy_mj(positions + step * motion) - part.energy_mj(positions - step * motion)
    assert 1e3 * change / (2.0 * step) == pytest.approx(work, rel=1e-6)
    further = part.terms(positions + motion)[0] - residual
    np.testing.assert_allclose(np.einsum("bij,bj->bi", stiffness, motion.ravel()[part.dofs]), further, atol=1e-6)


def test_gradual_parts_come_on_and_others_act_at_once() -> None:
    parts = _parts()
    springs, planes = parts_at([parts["springs"], parts["planes"]], 0.25)
    assert isinstance(springs, BackSprings)
    np.testing.assert_allclose(springs.pull_mm, [0.25, -0.5, 0.125])
    assert planes is parts["planes"]


def test_backs_without_springs_are_no_part() -> None:
    held = held_back(MESH.back_nodes(), np.ones(3, dtype=bool))
    assert back_springs(held, MESH.points) == ()
    assert back_springs(None, MESH.points) == ()


def test_extra_nodes_follow_what_they_hang_on() -> None:
    skin = np.setdiff1d(MESH.skin_nodes(), MESH.back_nodes())[::4]
    extra = MESH.points[skin] + 2.0
    own = len(MESH.points) + np.arange(len(skin))
    back = back_condition("slide_compression", MESH.points, MESH.back_quads(), along_kpa_per_mm=0.1)
    part = Pair(own, skin)
    closed = Closing(MODEL, MESH.skin_quads(), back, parts=[part], extra_nodes=extra).close(50.0)
    plain = Closing(MODEL, MESH.skin_quads(), back).close(50.0)
    assert plain.extra is None
    assert closed.extra is not None
    np.testing.assert_allclose(closed.deformed, plain.deformed, atol=1e-3)
    np.testing.assert_allclose(closed.extra, closed.deformed[skin], atol=1e-3)
    assert closed.report is not None
    assert closed.report.parts_mj["Pair"] == pytest.approx(0.0, abs=1e-6)


def test_prescribed_bodies_carry_extra_nodes_too() -> None:
    back = MESH.back_nodes()
    extra, own = MESH.points[-2:], len(MESH.points) + np.arange(2)
    tip = len(MESH.points) - 2 + np.arange(2)
    goal = MESH.points[back] + [0.0, 0.0, 3.0]
    result = solve_prescribed(MODEL, back, goal, parts=[Pair(own, tip)], extra_nodes=extra)
    assert result.extra is not None
    np.testing.assert_allclose(result.extra, extra + np.array([0.0, 0.0, 3.0]), atol=1e-3)


def test_extra_nodes_that_are_no_points_are_refused() -> None:
    with pytest.raises(ValueError, match="extra nodes must be"):
        all_nodes(MESH.points, np.zeros(3))


@pytest.mark.parametrize(("wanders", "least", "most"), [(False, 1, 1), (True, 3, 99)])
def test_linear_system_is_made_anew_only_for_parts_whose_partners_change(
    wanders: bool, least: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    prepare = DampedEquilibrium._prepare
    monkeypatch.setattr(DampedEquilibrium, "_prepare", lambda self, parts: (made.append(1), prepare(self, parts))[1])
    side = MESH.node_grid()[0, 1:3, 1:3].ravel()
    back = back_condition("slide_compression", MESH.points, MESH.back_quads(), along_kpa_per_mm=0.1)
    part = Pair(side, np.roll(side, 1), wanders, 0.01)
    Closing(MODEL, MESH.skin_quads(), back, parts=[part]).close(52.0)
    assert least <= len(made) <= most
