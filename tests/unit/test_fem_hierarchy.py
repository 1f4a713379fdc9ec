"""Grids of structured blocks: interpolation by node index and element matrices as a stencil."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.fem.linear.hierarchy import Hierarchy, block_size, interpolate_elements, interpolation
from mammoreg.fem.linear.system import node_dofs
from mammoreg.meshing.block import BlockMesh
from tests.unit.breast_block import breast_block


def index_grid(n: int) -> np.ndarray:
    """Node indices over the number of elements, (nodes, 3)."""
    line = np.arange(n + 1) / n
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


@given(st.integers(1, 9), st.integers(1, 9))
def test_trilinear_functions_of_the_index_are_interpolated_exactly(fine: int, coarse: int) -> None:
    def values(grid: np.ndarray) -> np.ndarray:
        return 2.0 + grid @ np.array([1.0, -3.0, 0.5])

    taken = interpolation(fine, coarse) @ values(index_grid(coarse))
    np.testing.assert_allclose(taken, values(index_grid(fine)), atol=1e-12)


@pytest.mark.parametrize(("n", "k"), [(2, 3), (3, 2), (4, 4)])
def test_nodes_of_a_subdivided_block_are_interpolated_from_its_own(n: int, k: int) -> None:
    block = breast_block(n)
    np.testing.assert_allclose(interpolation(n * k, n) @ block.points, block.subdivide(k).points, atol=1e-12)
    np.testing.assert_array_equal(block.subdivide(k).points[Hierarchy(n * k, n).coincident()], block.points)


def test_elements_take_the_value_of_their_parent() -> None:
    parents = np.arange(27)
    children = interpolate_elements(parents, 6, 3).reshape(6, 6, 6)
    assert (children[::2, ::2, ::2].ravel() == parents).all()
    assert (children[1::2, 1::2, 1::2].ravel() == parents).all()
    np.testing.assert_array_equal(interpolate_elements(interpolate_elements(parents, 6, 3), 3, 6), parents)


def test_stencil_is_the_sum_of_the_elements() -> None:
    n = 4
    hexes, rng = BlockMesh(n, np.zeros((125, 3))).hexes(), np.random.default_rng(5)
    blocks, left, right = (
        rng.standard_normal((64, 24, 24)),
        rng.standard_normal((64, 24)),
        rng.standard_normal((64, 24)),
    )
    grids = Hierarchy(n, 2)
    indptr = 27 * np.arange(126)
    stencil = sp.bsr_array((grids.stencil_values(blocks, left, right), grids.stencil(), indptr), shape=(375, 375))
    dofs, vector = node_dofs(hexes), rng.standard_normal(375)
    forces = np.einsum("eij,ej->ei", blocks - left[:, :, None] * right[:, None, :], vector[dofs])
    expected = np.bincount(dofs.ravel(), weights=forces.ravel())
    np.testing.assert_allclose(stencil @ vector, expected, atol=1e-12)


def test_only_structured_blocks_have_a_hierarchy() -> None:
    hexes = BlockMesh(12, np.zeros((13**3, 3))).hexes()
    assert block_size(hexes) == 12
    assert Hierarchy.of(hexes) == Hierarchy(12, 4)
    assert Hierarchy.of(hexes[::-1]) is None
    assert Hierarchy.of(hexes[:-1]) is None
    assert Hierarchy.of(BlockMesh(6, np.zeros((343, 3))).hexes()) is None
