"""Springs from points of faces to planes."""

import numpy as np
import pytest

from mammoreg.fem.parts.plane_ties import PlaneTies


def _ties(count: int = 5) -> tuple[PlaneTies, np.ndarray]:
    rng = np.random.default_rng(7)
    r, s = rng.uniform(size=(2, count))
    shape = np.stack([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s], axis=-1)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    nodes = np.array([rng.permutation(9)[:4] for _ in range(count)])
    ties = PlaneTies(nodes, shape, direction, rng.normal(size=count), rng.uniform(0.5, 3.0, count))
    return ties, 10.0 * rng.normal(size=(9, 3))


def _energy(ties: PlaneTies, positions: np.ndarray) -> float:
    return float(0.5 * np.sum(ties.stiffness * ties.distance(positions) ** 2))


def _assembled(ties: PlaneTies, positions: np.ndarray) -> np.ndarray:
    force = np.zeros_like(positions)
    np.add.at(force, ties.nodes.ravel(), ties.force(positions).reshape(-1, 3))
    return force


def test_force_is_the_gradient_of_the_energy() -> None:
    ties, positions = _ties()
    step, gradient = 1e-4, np.zeros_like(positions)
    for index in np.ndindex(*positions.shape):
        moved = np.zeros_like(positions)
        moved[index] = step
        gradient[index] = (_energy(ties, positions + moved) - _energy(ties, positions - moved)) / (2.0 * step)
    np.testing.assert_allclose(_assembled(ties, positions), gradient, atol=1e-6)


def test_blocks_are_the_derivative_of_the_force() -> None:
    ties, positions = _ties()
    motion = np.random.default_rng(1).normal(size=positions.shape)
    change = ties.force(positions + motion) - ties.force(positions)
    local = motion[ties.nodes].reshape(len(ties.nodes), 12)
    np.testing.assert_allclose(np.einsum("tij,tj->ti", ties.blocks(), local), change, atol=1e-10)


def test_points_on_their_planes_feel_nothing_and_slide_freely() -> None:
    ties, positions = _ties(1)
    face = ties.nodes[0]
    positions[face] -= ties.distance(positions)[0] * ties.direction[0]
    along = np.cross(ties.direction[0], [0.3, -0.5, 0.8])
    positions[face] += 4.0 * along
    assert ties.force(positions) == pytest.approx(np.zeros((1, 12)), abs=1e-10)


def test_the_pull_on_a_face_is_stiffness_times_distance_towards_the_plane() -> None:
    ties, positions = _ties()
    total = ties.force(positions).reshape(-1, 4, 3).sum(axis=1)
    expected = (ties.stiffness * ties.distance(positions))[:, None] * ties.direction
    np.testing.assert_allclose(total, expected, atol=1e-10)


def test_parts_of_a_set_joined_again_pull_alike() -> None:
    ties, positions = _ties()
    some = np.array([True, False, True, True, False])
    again = ties.kept(~some).joined(ties.kept(some))
    np.testing.assert_allclose(_assembled(again, positions), _assembled(ties, positions))
