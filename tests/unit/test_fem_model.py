"""Residual and tangent of the u-p0 hexahedra against closed forms, finite differences and scikit-fem."""

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray

from mammoreg.fem.hexahedra import VTK_IN_SKFEM, hexahedra, jacobians, skfem_basis
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.prescribed import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block, distorted, rotation

Floats = NDArray[np.float64]
FIBRE = np.array([0.3, 1.0, -0.2])
AFFINE = np.array([[1.2, 0.1, 0.0], [-0.05, 1.1, 0.2], [0.1, 0.0, 0.8]])


def deformed(model: HyperelasticModel, seed: int = 1) -> Floats:
    """A smooth large deformation plus some noise."""
    rng = np.random.default_rng(seed)
    return np.asarray(model.points @ AFFINE.T + 0.4 * rng.standard_normal(model.points.shape))


def assembled(model: HyperelasticModel, blocks: Floats) -> Floats:
    sums = np.bincount(model.dofs.ravel(), weights=blocks.ravel(), minlength=model.points.size)
    return np.asarray(sums, dtype=float)


def internal_force(model: HyperelasticModel, positions: Floats, pressure: Floats) -> Floats:
    return assembled(model, model.residual(model.state(positions), pressure).force)


@pytest.fixture(params=[None, 12.0], ids=["isotropic", "fibres"])
def model(request: pytest.FixtureRequest) -> HyperelasticModel:
    mesh = distorted(2)
    mu = np.linspace(5.0, 20.0, 8)
    material = neo_hookean(mu, 0.49, FIBRE if request.param else None, request.param)
    return HyperelasticModel(mesh.points, mesh.hexes(), material)


def test_force_is_the_derivative_of_the_energy(model: HyperelasticModel) -> None:
    positions = deformed(model)
    pressure = np.linspace(-20.0, 5.0, 8)
    direction = np.random.default_rng(2).standard_normal(positions.shape)

    def potential(step: float) -> float:
        moved = positions + step * direction
        volume = (model.weights * (model.determinants(moved) - 1.0)).sum(axis=1)
        return model.energy_mj(moved) * 1e3 + float(pressure @ volume)

    slope = (potential(1e-4) - potential(-1e-4)) / 2e-4
    assert internal_force(model, positions, pressure) @ direction.ravel() == pytest.approx(slope, rel=1e-6)


def test_tangent_is_the_derivative_of_the_force_with_pressures_eliminated(model: HyperelasticModel) -> None:
    positions = deformed(model)
    pressure = np.linspace(-20.0, 5.0, 8)
    direction = np.random.default_rng(3).standard_normal(positions.shape)
    state = model.state(positions)
    coupling = model.residual(state, pressure).coupling
    blocks = model.stiffness(state, pressure, coupling)
    np.testing.assert_allclose(blocks, blocks.transpose(0, 2, 1), atol=1e-8 * np.abs(blocks).max())
    product = assembled(model, np.einsum("eij,ej->ei", blocks, direction.ravel()[model.dofs]))
    rate = model.bulk_per_volume * np.einsum("ei,ei->e", coupling, direction.ravel()[model.dofs])
    step = 1e-5
    plus = internal_force(model, positions + step * direction, pressure + step * rate)
    minus = internal_force(model, positions - step * direction, pressure - step * rate)
    np.testing.assert_allclose(product, (plus - minus) / (2 * step), rtol=1e-5, atol=1e-4 * np.abs(product).max())


def test_rigid_motion_makes_no_force(model: HyperelasticModel) -> None:
    moved = model.points @ rotation((1.0, 2.0, 3.0), 1.0).T + np.array([5.0, -7.0, 2.0])
    assert np.abs(internal_force(model, moved, np.zeros(8))).max() < 1e-8
    assert model.energy_mj(moved) == pytest.approx(0.0, abs=1e-9)
    assert model.volume_change(moved) == pytest.approx(0.0, abs=1e-12)


def test_forces_turn_with_the_body(model: HyperelasticModel) -> None:
    turn = rotation((0.0, 1.0, 0.3), 0.7)
    positions = deformed(model)
    pressure = np.full(8, -3.0)
    turned = internal_force(model, positions @ turn.T, pressure).reshape(-1, 3)
    np.testing.assert_allclose(turned, internal_force(model, positions, pressure).reshape(-1, 3) @ turn.T, atol=1e-7)


def test_fibres_carry_tension_only() -> None:
    mesh = block(1, (10.0, 10.0, 10.0))
    along = np.array([0.0, 1.0, 0.0])
    plain = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0))
    fibres = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, fibre=along, fibre_kpa=7.0))
    for stretch, extra in ((0.7, 0.0), (1.3, 0.5 * 7.0 * (1.3**2 - 1.0) ** 2)):
        positions = mesh.points * np.array([stretch**-0.5, stretch, stretch**-0.5])
        difference = fibres.energy_mj(positions) - plain.energy_mj(positions)
        assert difference == pytest.approx(extra * 1000.0 * 1e-3, abs=1e-9)


def test_patch_test_affine_boundary_gives_the_affine_interior() -> None:
    mesh = distorted(3, seed=4)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(np.full(27, 10.0), 0.499))
    gradient = AFFINE / np.cbrt(np.linalg.det(AFFINE))
    surface = np.flatnonzero((np.abs(mesh.points) > 29.999).any(axis=1))
    result = solve_prescribed(model, surface, mesh.points[surface] @ gradient.T)
    np.testing.assert_allclose(result.deformed, mesh.points @ gradient.T, atol=1e-6)
    np.testing.assert_allclose(result.pressure, result.pressure[0], atol=1e-5)


def test_displacements_do_not_depend_on_the_scale_of_stiffness_and_forces_follow_it() -> None:
    mesh = distorted(3)
    top = np.flatnonzero(mesh.points[:, 2] > 29.999)
    bottom = np.flatnonzero(mesh.points[:, 2] < -29.999)
    nodes = np.concatenate([top, bottom])
    targets = mesh.points[nodes] + np.repeat([[4.0, 0.0, -12.0], [0.0, 0.0, 0.0]], [len(top), len(bottom)], axis=0)
    soft, stiff = (
        solve_prescribed(HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(mu, 0.495)), nodes, targets)
        for mu in (3.0, 30.0)
    )
    np.testing.assert_allclose(stiff.deformed, soft.deformed, atol=1e-3)
    np.testing.assert_allclose(stiff.pressure, 10.0 * soft.pressure, rtol=1e-3, atol=1e-3)
    assert soft.energy_mj * 10.0 == pytest.approx(stiff.energy_mj, rel=1e-4)


def test_assembly_agrees_with_a_scikit_fem_form() -> None:
    """Linear elasticity of scikit-fem: the tangent at rest without the pressure's part."""
    mesh = distorted(2, seed=5)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.49))
    nothing = np.zeros(8)
    state = model.state(model.points)
    blocks = model.stiffness(state, nothing, np.zeros((8, 24)))
    scalar = skfem_basis(mesh.points, mesh.hexes())
    basis = skfem.Basis(scalar.mesh, skfem.ElementVector(skfem.ElementHex1()), intorder=3)

    def isochoric(u: skfem.element.DiscreteField, v: skfem.element.DiscreteField, _: object) -> Floats:
        strain = 0.5 * (u.grad + u.grad.transpose(1, 0, 2, 3))
        test = 0.5 * (v.grad + v.grad.transpose(1, 0, 2, 3))
        volumetric = np.einsum("ii...->...", strain) * np.einsum("ii...->...", test) / 3.0
        return np.asarray(2.0 * 10.0 * (np.einsum("ij...,ij...->...", strain, test) - volumetric))

    expected = skfem.BilinearForm(isochoric).assemble(basis).toarray()
    number = basis.nodal_dofs.T.ravel()
    own = np.zeros(expected.shape)
    for dofs, stiffness in zip(model.dofs, blocks, strict=True):
        own[np.ix_(dofs, dofs)] += stiffness
    np.testing.assert_allclose(own, expected[np.ix_(number, number)], atol=1e-9 * np.abs(expected).max())


def test_force_agrees_with_a_scikit_fem_form_at_large_deformation() -> None:
    mesh = distorted(2, seed=6)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.49))
    positions, pressure = deformed(model), np.linspace(-9.0, 4.0, 8)
    scalar = skfem_basis(mesh.points, mesh.hexes())
    basis = skfem.Basis(scalar.mesh, skfem.ElementVector(skfem.ElementHex1()), intorder=3)
    place = np.zeros(basis.N)
    place[basis.nodal_dofs.T.ravel()] = positions.ravel()

    def first_piola(v: skfem.element.DiscreteField, w: skfem.assembly.form.form.FormExtraParams) -> Floats:
        gradient = w["place"].grad.transpose(2, 3, 0, 1)
        det, inverse = np.linalg.det(gradient)[..., None, None], np.linalg.inv(gradient).swapaxes(-1, -2)
        size = (gradient**2).sum(axis=(-1, -2))[..., None, None]
        stress = 10.0 * det ** (-2.0 / 3.0) * (gradient - size / 3.0 * inverse)
        stress += pressure[:, None, None, None] * det * inverse
        return np.asarray(np.einsum("ij...,ij...->...", stress.transpose(2, 3, 0, 1), v.grad))

    expected = skfem.LinearForm(first_piola).assemble(basis, place=basis.interpolate(place))
    np.testing.assert_allclose(
        internal_force(model, positions, pressure), expected[basis.nodal_dofs.T.ravel()], atol=1e-8
    )


def test_weights_add_up_to_the_volume_and_inverted_elements_are_refused() -> None:
    mesh = distorted(3)
    geometry = hexahedra(mesh.points, mesh.hexes())
    assert geometry.volume.sum() == pytest.approx(60.0**3)
    np.testing.assert_allclose(jacobians(mesh.points, mesh.hexes()).sum(axis=1) / 8.0, geometry.volume)
    assert sorted(VTK_IN_SKFEM) == list(range(8))
    with pytest.raises(ValueError, match="27 of 27 elements are inside out"):
        hexahedra(mesh.points * np.array([-1.0, 1.0, 1.0]), mesh.hexes())
