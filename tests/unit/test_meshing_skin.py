"""Facets cut from the faces of a block."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mammoreg.meshing.skin import skin_facets
from tests.unit.block_meshes import half_ellipsoid
from tests.unit.fe_bodies import distorted


def _area_vectors(corners: np.ndarray) -> np.ndarray:
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), k=st.integers(1, 5))
def test_facets_lie_on_the_bilinear_face(seed: int, k: int) -> None:
    nodes = np.random.default_rng(seed).normal(size=(4, 3))
    facets = skin_facets(np.array([[2, 0, 3, 1]]), 4, k)
    corners = facets.positions(nodes)[facets.quads[:, 0]]
    r, s = np.meshgrid(np.arange(k) / k, np.arange(k) / k, indexing="ij")
    r, s = r.reshape(-1, 1), s.reshape(-1, 1)
    face = nodes[[2, 0, 3, 1]]
    expected = (1 - r) * (1 - s) * face[0] + r * (1 - s) * face[1] + r * s * face[2] + (1 - r) * s * face[3]
    np.testing.assert_allclose(corners, expected, atol=1e-12)


@pytest.mark.parametrize("k", [1, 2, 4])
def test_facets_tile_their_faces_and_look_outwards(k: int) -> None:
    mesh = half_ellipsoid(4)
    faces = mesh.skin_quads()
    facets = skin_facets(faces, len(mesh.points), k)
    cut = _area_vectors(facets.positions(mesh.points)[facets.quads]).reshape(len(faces), k * k, 3)
    whole = _area_vectors(mesh.points[faces])
    # The area vector of a bilinear face depends on its rim alone, so the facets' add up to it.
    np.testing.assert_allclose(cut.sum(axis=1), whole, atol=1e-9)
    assert (np.einsum("fqi,fi->fq", cut, whole) > 0.0).all()


def test_facets_with_the_back_enclose_the_volume() -> None:
    mesh = distorted(3, size=30.0)
    faces = np.concatenate([mesh.skin_quads(), mesh.back_quads()])
    facets = skin_facets(faces, len(mesh.points), 3)
    corners = facets.positions(mesh.points)[facets.quads]
    flux = np.einsum("qi,qi->", corners.mean(axis=1), _area_vectors(corners)) / 3.0
    assert flux == pytest.approx(30.0**3, rel=1e-9), "the outer faces are plane"


def test_a_common_edge_has_the_same_corners_on_both_faces() -> None:
    mesh = half_ellipsoid(3)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), 2)
    places = np.unique(np.round(facets.positions(mesh.points), 9), axis=0)
    faces, nodes = len(mesh.skin_quads()), len(mesh.skin_nodes())
    rim = 4 * mesh.n
    edges = (4 * faces + rim) // 2
    assert len(places) == nodes + edges + faces


@pytest.mark.parametrize("k", [1, 3])
def test_rim_is_where_the_skin_meets_the_back(k: int) -> None:
    mesh = half_ellipsoid(4)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), k)
    on_back = np.isclose(facets.positions(mesh.points)[:, 1], mesh.points[mesh.back_nodes(), 1].max())
    np.testing.assert_array_equal(facets.rim, on_back)
    assert facets.rim.any()


def test_closed_surface_has_no_rim() -> None:
    mesh = half_ellipsoid(3)
    faces = np.concatenate([mesh.skin_quads(), mesh.back_quads()])
    assert not skin_facets(faces, len(mesh.points), 2).rim.any()
