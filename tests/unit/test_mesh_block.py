"""Block meshes: numbering, faces, refinement, transfinite interpolation, quality measures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.fractions import tissue_fraction
from mammoreg.meshing.quality import scaled_jacobians, surface_distances
from mammoreg.meshing.transfinite import fill_block, fill_face
from mammoreg.meshing.trilinear import CORNERS, GAUSS_POINTS, volumes


def bent_block(n, seed=0, noise=0.0):
    """A block bent and twisted smoothly, its nodes shaken by `noise` mm."""
    side = np.linspace(-1.0, 1.0, n + 1)
    k, j, i = np.meshgrid(side, side, side, indexing="ij")
    points = np.stack([40.0 * i, -50.0 * k, 45.0 * j], axis=-1).reshape(-1, 3)
    points = points + 8.0 * np.sin(points[:, [1, 2, 0]] / 30.0)
    return BlockMesh(n, points + noise * np.random.default_rng(seed).normal(size=points.shape))


def flux_volume(points, quads):
    """Volume inside outward bilinear faces by the divergence theorem, exact with 2 x 2 Gauss points."""
    total, g = 0.0, 1.0 / np.sqrt(3.0)
    for u, v in [(-g, -g), (g, -g), (g, g), (-g, g)]:
        shape = 0.25 * np.array([(1 - u) * (1 - v), (1 + u) * (1 - v), (1 + u) * (1 + v), (1 - u) * (1 + v)])
        by_u = 0.25 * np.array([-(1 - v), 1 - v, 1 + v, -(1 + v)])
        by_v = 0.25 * np.array([-(1 - u), -(1 + u), 1 + u, 1 - u])
        corners = points[quads]
        place, a, b = (np.einsum("a,fac->fc", weight, corners) for weight in (shape, by_u, by_v))
        total += np.einsum("fc,fc->", place, np.cross(a, b)) / 3.0
    return total


def test_node_numbers_run_medial_then_superior_then_front():
    mesh = BlockMesh(2, np.arange(81.0).reshape(27, 3))
    assert mesh.node_grid()[2, 1, 0] == 5
    assert mesh.node_grid()[0, 0, 1] == 9
    assert set(mesh.back_nodes()) == set(range(9))
    assert len(mesh.skin_nodes()) == 25
    assert 13 not in mesh.skin_nodes()
    assert 4 not in BlockMesh(2, mesh.points).skin_quads()


def test_faces_are_outward_and_closed():
    mesh = bent_block(4)
    quads = np.concatenate([mesh.skin_quads(), mesh.back_quads()])
    inside = volumes(mesh.points[mesh.hexes()])
    assert (inside > 0).all()
    assert flux_volume(mesh.points, quads) == pytest.approx(inside.sum(), rel=1e-9)
    edges = np.concatenate([quads[:, [a, (a + 1) % 4]] for a in range(4)])
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}


@given(st.integers(1, 4), st.integers(1, 4))
def test_subdivision_keeps_the_volume_and_the_old_nodes(n, k):
    mesh = bent_block(n)
    fine = mesh.subdivide(k)
    assert fine.n == n * k
    assert volumes(fine.points[fine.hexes()]).sum() == pytest.approx(volumes(mesh.points[mesh.hexes()]).sum())
    kept = fine.points[fine.node_grid()[::k, ::k, ::k]]
    np.testing.assert_allclose(kept, mesh.points[mesh.node_grid()], atol=1e-12)


def test_block_refuses_a_wrong_number_of_points():
    with pytest.raises(ValueError, match="64 points"):
        BlockMesh(3, np.zeros((27, 3)))
    with pytest.raises(ValueError, match="into 0 parts"):
        bent_block(1).subdivide(0)


def test_transfinite_interpolation_reproduces_a_trilinear_map():
    mesh = BlockMesh(1, bent_block(1, noise=5.0).points).subdivide(6)
    block = mesh.points[mesh.node_grid()]
    hollow = block.copy()
    hollow[1:-1, 1:-1, 1:-1] = 1e6
    np.testing.assert_allclose(fill_block(hollow), block, atol=1e-9)
    face = block[:, :, 0].copy()
    face[1:-1, 1:-1] = -1e6
    np.testing.assert_allclose(fill_face(face), block[:, :, 0], atol=1e-9)


def test_scaled_jacobian_is_the_sine_of_a_sheared_bricks_angle():
    brick = 0.5 * (CORNERS + 1.0) * [2.0, 3.0, 5.0]
    sheared = brick + np.outer(brick[:, 1], [1.0, 0.0, 0.0])
    found = scaled_jacobians(np.stack([brick, sheared, sheared[:, [1, 0, 2]]]), GAUSS_POINTS)
    np.testing.assert_allclose(found[0], 1.0)
    np.testing.assert_allclose(found[1], np.sin(np.pi / 4))
    np.testing.assert_allclose(found[2], -np.sin(np.pi / 4))


def test_surface_distance_of_an_inflated_box():
    box = BlockMesh(1, 0.5 * (CORNERS[[0, 1, 3, 2, 4, 5, 7, 6]]) * [60.0, 50.0, 40.0]).subdivide(2)
    larger = BlockMesh(2, box.points * (1.0 + 4.0 / np.array([60.0, 50.0, 40.0]))).subdivide(30)
    used, quads = np.unique(np.concatenate([larger.skin_quads(), larger.back_quads()]), return_inverse=True)
    quads = quads.reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    distance = surface_distances(box, larger.points[used], triangles)
    assert np.median(distance) == pytest.approx(2.0, abs=0.3)
    assert distance.max() < 2.0 * np.sqrt(3.0) + 0.8


def test_tissue_fraction_of_layers():
    labels = np.ones((40, 40, 40), dtype=np.uint8)
    labels[:, :, 20:] = 2
    labels[:, :, 35:] = 0
    mesh = BlockMesh(1, 0.5 * (CORNERS[[0, 1, 3, 2, 4, 5, 7, 6]] + 1.0) * 40.0 - 0.5).subdivide(2)
    found = tissue_fraction(mesh, Volume(labels, np.zeros(3), np.ones(3)), 2, (1, 2))
    np.testing.assert_allclose(found, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    whole = tissue_fraction(BlockMesh(1, mesh.points[mesh.node_grid()[::2, ::2, ::2].ravel(order="F")]),
                            Volume(labels, np.zeros(3), np.ones(3)), 2, (1, 2, 0))  # fmt: skip
    assert whole[0] == pytest.approx(15.0 / 40.0, abs=0.05)
    assert tissue_fraction(mesh, Volume(labels * 0, np.zeros(3), np.ones(3)), 2, (1, 2)).max() == 0.0


def test_tissue_fraction_of_an_element_that_narrows_is_of_its_volume():
    wide, narrow, height = 30.0, 6.0, 40.0
    corners = 0.5 * CORNERS[[0, 1, 3, 2, 4, 5, 7, 6]]
    side = wide + (narrow - wide) * (corners[:, 2:] + 0.5)
    frustum = BlockMesh(1, corners * np.hstack([side, side, np.full((8, 1), height)]))
    labels = np.ones((64, 64, 80), dtype=np.uint8)
    labels[:, :, :40] = 2  # gland fills the wide half, where four fifths of the volume lie
    found = tissue_fraction(frustum, Volume(labels, np.array([-15.75, -15.75, -19.75]), np.full(3, 0.5)), 2, (1, 2))
    middle = 0.5 * (wide + narrow)
    below, above = (a**2 + a * middle + middle**2 for a in (wide, narrow))
    assert found[0] == pytest.approx(below / (below + above), abs=0.005)
