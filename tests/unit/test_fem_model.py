"""Residual and tangent of the u-p0 hexahedra against closed forms, finite differences and scikit-fem."""

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray

from mammoreg.fem.elements.hexahedra import VTK_IN_SKFEM, hexahedra, jacobians, skfem_basis
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.catalogue import CATALOGUE, SKIN
from mammoreg.materials.elastic import ElasticMaterial, hyperelastic, neo_hookean
from mammoreg.materials.fibres import Fibres
from mammoreg.materials.laws import Exponential, Linear, NeoHookean, Tabulated
from mammoreg.materials.mixture import TissueMixture
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


def mixed() -> TissueMixture:
    """Three tissues, pure and mixed, over the eight elements of a block of two a side."""
    gland = np.array([0.0, 1.0, 0.5, 0.0, 0.2, 0.0, 0.9, 0.4])
    skin = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.3, 0.1, 0.6])
    laws = (Exponential(4.46, 7.4), Exponential(20.65, 6.09), Linear(10.0))
    return TissueMixture(laws, np.stack([1.0 - gland - skin, gland, skin], axis=1))


MATERIALS: dict[str, ElasticMaterial] = {
    "neo-hookean": neo_hookean(np.linspace(5.0, 20.0, 8), 0.49),
    "fibres": neo_hookean(np.linspace(5.0, 20.0, 8), 0.49, FIBRE, 12.0),
    "stiffening fibres": neo_hookean(np.linspace(5.0, 20.0, 8), 0.49, FIBRE, np.linspace(2.0, 12.0, 8), 1.5),
    "mixture": hyperelastic(mixed(), 0.49),
    "mixture with fibres": hyperelastic(mixed(), 0.49, fibres=Fibres(FIBRE, 12.0, 0.7)),
    "table": hyperelastic(Tabulated((0.1, 0.2, 0.3, 0.4, 0.5), (1.0, 2.5, 4.5, 7.5, 12.0)), 0.49),
    "skin": hyperelastic(SKIN.law, 0.49),
} | {
    f"{name} {tissue}": hyperelastic(getattr(entry, tissue).law, 0.49)
    for name, entry in CATALOGUE.items()
    for tissue in ("fat", "gland")
    if name not in ("lorenzen", "homogeneous")
}


@pytest.fixture(params=list(MATERIALS.values()), ids=list(MATERIALS))
def model(request: pytest.FixtureRequest) -> HyperelasticModel:
    mesh = distorted(2)
    return HyperelasticModel(mesh.points, mesh.hexes(), request.param)


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


def test_no_energy_is_gained_on_a_closed_path(model: HyperelasticModel) -> None:
    """Work of the internal forces around a loop of deformations, by the trapezoidal rule, which is exact to O(h^2)."""
    base, pressure = model.points, np.zeros(8)
    rng = np.random.default_rng(7)
    first, second = (0.25 * base @ rng.standard_normal((3, 3)) for _ in range(2))
    work, size, before = 0.0, 0.0, None
    for angle in np.linspace(0.0, 2.0 * np.pi, 201):
        place = base + (1.0 - np.cos(angle)) * first + np.sin(angle) * second
        force = internal_force(model, place, pressure)
        if before is not None:
            amount = 0.5 * float((force + before[1]) @ (place - before[0]).ravel())
            work, size = work + amount, size + abs(amount)
        before = (place, force)
    assert abs(work) < 2e-3 * size


@pytest.mark.parametrize("name", [name for name, material in MATERIALS.items() if material.fibres is None])
def test_laws_agree_with_the_closed_form_under_uniaxial_compression(name: str) -> None:
    """Volume kept: the stress along the axis less that across it is 2 W' (l^2 - 1/l)."""
    mesh, stretch = distorted(2), 0.6
    model = HyperelasticModel(mesh.points, mesh.hexes(), MATERIALS[name])
    state = model.state(model.points * np.array([stretch**-0.5, stretch**-0.5, stretch]))
    law = model.material.law
    i1 = np.full(state.det.shape, stretch**2 + 2.0 / stretch)
    slope = 0.5 * model.material.mu_kpa[:, None] if law is None else law.slope_kpa(i1)
    expected = np.broadcast_to(2.0 * slope * (stretch**2 - 1.0 / stretch), state.det.shape)
    np.testing.assert_allclose(state.deviator[..., 2] - state.deviator[..., 0], expected, rtol=1e-9)


def test_neo_hookean_body_computes_no_curvature_and_a_body_without_fibres_none_of_theirs() -> None:
    mesh = distorted(2)
    terms = {name: HyperelasticModel(mesh.points, mesh.hexes(), material) for name, material in MATERIALS.items()}
    bends = {name: len(body.state(body.points).runs[0].bends) for name, body in terms.items()}
    assert [bends[name] for name in ("neo-hookean", "fibres", "mixture", "mixture with fibres")] == [0, 1, 1, 2]
    assert terms["neo-hookean"].state(mesh.points).runs[0].fibre is None
    assert bends["samani gland"] == 0


def test_runs_of_elements_do_not_show() -> None:
    """More elements than a run holds: each is as if it were alone."""
    mesh = distorted(5, seed=8)
    mu = np.linspace(5.0, 20.0, 125)
    shares = np.linspace(0.0, 1.0, 125)
    law = TissueMixture((NeoHookean(4.0), Exponential(20.65, 6.09)), np.stack([shares, 1.0 - shares], axis=1))
    for material in (neo_hookean(mu, 0.49, FIBRE, mu), hyperelastic(law, 0.49)):
        model = HyperelasticModel(mesh.points, mesh.hexes(), material)
        positions, pressure = deformed(model), np.linspace(-9.0, 4.0, 125)
        state = model.state(positions)
        internal = model.residual(state, pressure)
        blocks = model.stiffness(state, pressure, internal.coupling)
        for element in (0, 63, 64, 124):
            part = slice(element, element + 1)
            alone = HyperelasticModel(mesh.points, mesh.hexes()[part], model.material.part(part))
            own = alone.state(positions)
            force = alone.residual(own, pressure[part])
            np.testing.assert_allclose(force.force[0], internal.force[element], atol=1e-9)
            block_alone = alone.stiffness(own, pressure[part], force.coupling)[0]
            np.testing.assert_allclose(block_alone, blocks[element], atol=1e-9 * np.abs(blocks).max())


def test_volumetric_energy_is_that_of_the_pressures() -> None:
    mesh = block(2, (10.0, 10.0, 10.0))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.49))
    change = 0.02
    pressure = np.full(8, change * model.material.bulk_kpa[0])
    expected_mj = 0.5 * model.material.bulk_kpa[0] * change**2 * 1000.0 * 1e-3
    assert model.volumetric_energy_mj(pressure) == pytest.approx(expected_mj)
    assert np.abs(model.residual(model.state(mesh.points * (1.0 + change) ** (1 / 3)), pressure).volume).max() < 1e-9


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
