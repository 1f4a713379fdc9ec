"""Assembly of blocks and the two direct solvers."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.errors import NotConvergedError
from mammoreg.fem.linear.direct import PardisoSolver, SuperLuSolver
from mammoreg.fem.linear.sparse import Assembler


@given(st.integers(0, 1000), st.booleans())
def test_assembled_blocks_are_their_dense_sum_over_the_free_unknowns(seed: int, symmetric: bool) -> None:
    rng = np.random.default_rng(seed)
    groups = [rng.integers(0, 9, (5, 3)), rng.integers(0, 9, (4, 2))]
    blocks = [rng.standard_normal((5, 3, 3)), rng.standard_normal((4, 2, 2))]
    blocks = [block + block.transpose(0, 2, 1) for block in blocks]
    free = np.flatnonzero(rng.random(9) < 0.7)
    dense = np.zeros((9, 9))
    for group, block in zip(groups, blocks, strict=True):
        for dofs, values in zip(group, block, strict=True):
            np.add.at(dense, (dofs[:, None], dofs[None]), values)
    assembler = Assembler(groups, free, 9, symmetric)
    size = len(free)
    own = sp.csr_array((assembler.values(blocks), assembler.indices, assembler.indptr), shape=(size, size)).toarray()
    expected = dense[np.ix_(free, free)]
    np.testing.assert_allclose(own, np.triu(expected) if symmetric else expected, atol=1e-12)


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("kind", [PardisoSolver, SuperLuSolver])
def test_both_solvers_solve_again_with_new_values_of_one_pattern(
    kind: type[PardisoSolver] | type[SuperLuSolver], symmetric: bool
) -> None:
    if kind is PardisoSolver:
        pytest.importorskip("pypardiso")
    rng = np.random.default_rng(3)
    size = 40
    pattern = rng.random((size, size)) < 0.2
    pattern |= pattern.T | np.eye(size, dtype=bool)
    kept = np.triu(pattern) if symmetric else pattern
    structure = sp.csr_array(kept)
    solver = kind(structure.indptr.astype(np.int32), structure.indices.astype(np.int32), symmetric)
    for _ in range(2):
        matrix = np.where(pattern, rng.standard_normal((size, size)), 0.0)
        matrix = matrix + matrix.T - 3.0 * np.diag(np.arange(size) % 5 - 2.0)  # indefinite
        rhs = rng.standard_normal(size)
        np.testing.assert_allclose(matrix @ solver.solve(matrix[kept], rhs), rhs, atol=1e-8)


def test_values_that_are_not_finite_or_singular_are_refused() -> None:
    indptr, indices = np.array([0, 1, 2], dtype=np.int32), np.array([0, 1], dtype=np.int32)
    with pytest.raises(NotConvergedError, match="linear solver failed"):
        SuperLuSolver(indptr, indices, True).solve(np.array([1.0, 0.0]), np.ones(2))
    pytest.importorskip("pypardiso")
    with pytest.raises(NotConvergedError, match="not finite"):
        PardisoSolver(indptr, indices, True).solve(np.array([1.0, np.nan]), np.ones(2))


@pytest.mark.parametrize("kind", [PardisoSolver, SuperLuSolver])
def test_factors_serve_more_than_one_right_hand_side(kind: type[PardisoSolver] | type[SuperLuSolver]) -> None:
    if kind is PardisoSolver:
        pytest.importorskip("pypardiso")
    solver = kind(np.array([0, 2, 3], dtype=np.int32), np.array([0, 1, 1], dtype=np.int32), True)
    solver.factorise(np.array([2.0, 1.0, 3.0]))
    matrix = np.array([[2.0, 1.0], [1.0, 3.0]])
    for rhs in np.eye(2):
        np.testing.assert_allclose(matrix @ solver.back_substitute(rhs), rhs, atol=1e-12)
    assert solver.factorisations == 1


@pytest.mark.parametrize("kind", [PardisoSolver, SuperLuSolver])
def test_strided_and_integer_vectors_are_read_as_they_are(kind: type[PardisoSolver] | type[SuperLuSolver]) -> None:
    if kind is PardisoSolver:
        pytest.importorskip("pypardiso")
    solver = kind(np.array([0, 1, 2, 3], dtype=np.int32), np.array([0, 1, 2], dtype=np.int32), True)
    columns = np.asfortranarray([[1.0, 2.0, 3.0], [5.0, 5.0, 5.0]])
    np.testing.assert_allclose(solver.solve(np.array([2, 3, 4]), columns[0]), [0.5, 2.0 / 3.0, 0.75], rtol=1e-12)
