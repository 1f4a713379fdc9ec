"""Small strains of a body: against the closed form, and one factorisation for all loads."""

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.linear_elastic import LinearElasticBody
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from mammoreg.meshing.block import BlockMesh

MU_KPA, POISSON, SIDE_MM = 4.0, 0.3, 12.0


def bent_cube(n: int = 3) -> BlockMesh:
    """A cube whose inner nodes are out of line."""
    line = np.linspace(0.0, SIDE_MM, n + 1)
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    inner = ((points > 0.0) & (points < SIDE_MM)).all(axis=1)
    points[inner] += 0.1 * SIDE_MM / n * np.random.default_rng(1).standard_normal((inner.sum(), 3))
    return BlockMesh(n, points)


def sliding_cube() -> tuple[HyperelasticModel, LinearElasticBody]:
    """Free to spread, its height held below and above."""
    mesh = bent_cube()
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(MU_KPA, POISSON))
    held = mesh.points == 0.0
    held[:, 2] |= mesh.points[:, 2] == SIDE_MM
    return model, LinearElasticBody(model, held)


def test_uniaxial_strain_is_the_closed_form() -> None:
    model, body = sliding_cube()
    lowered = np.where(model.points == SIDE_MM, -0.06, 0.0)
    solved = body.solve(prescribed=lowered)
    strain = -0.06 / SIDE_MM
    np.testing.assert_allclose(solved.displacement[:, 2], strain * model.points[:, 2], atol=1e-12)
    np.testing.assert_allclose(solved.displacement[:, :2], -POISSON * strain * model.points[:, :2], atol=1e-12)
    young = 2.0 * MU_KPA * (1.0 + POISSON)
    above = model.points[:, 2] == SIDE_MM
    assert solved.reaction[above, 2].sum() == pytest.approx(young * strain * SIDE_MM**2)
    np.testing.assert_allclose(solved.pressure, young * strain / 3.0, rtol=1e-9)


def test_every_load_is_solved_with_one_factorisation() -> None:
    model, body = sliding_cube()
    force = np.zeros(model.points.shape)
    force[model.points[:, 0] == SIDE_MM, 0] = 2.0
    lowered = np.where(model.points == SIDE_MM, -0.06, 0.0)
    apart = body.solve(prescribed=lowered).displacement + 3.0 * body.solve(force=force).displacement
    np.testing.assert_allclose(body.solve(lowered, 3.0 * force).displacement, apart, atol=1e-12)
    assert body.factorisations == 1


def test_it_is_the_hyperelastic_body_at_small_strains() -> None:
    model, _ = sliding_cube()
    skin = np.flatnonzero(((model.points == 0.0) | (model.points == SIDE_MM)).any(axis=1))
    small = 1e-4 * np.random.default_rng(2).standard_normal((len(skin), 3))
    held = np.zeros(model.points.shape, dtype=bool)
    held[skin] = True
    prescribed = np.zeros(model.points.shape)
    prescribed[skin] = small
    linear = LinearElasticBody(model, held).solve(prescribed)
    nonlinear = solve_prescribed(model, skin, model.points[skin] + small).deformed - model.points
    np.testing.assert_allclose(linear.displacement, nonlinear, atol=1e-7)
