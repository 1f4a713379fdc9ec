"""The paper's four models of skin: their interface, and breasts between plates that wear them."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import back_condition
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.fem.skin.interface import SkinInterface, skin_interface
from mammoreg.fem.skin.law import TensionLinear
from mammoreg.fem.skin.membrane import Membrane
from mammoreg.fem.skin.models import SkinModel, rim_nodes, skin_model
from mammoreg.fem.skin.surface import QuadSurface
from mammoreg.materials.elastic import neo_hookean
from tests.unit.block_meshes import half_ellipsoid
from tests.unit.fe_bodies import block, rotation
from tests.unit.membranes import assembled, assert_energy_force_and_stiffness_agree, relaxed, sheet, tube

MU = 2.0
MESH = half_ellipsoid(5)


def _model(mesh=MESH) -> HyperelasticModel:
    return HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(MU, 0.495))


def _closed(
    model: HyperelasticModel,
    skin: SkinModel,
    compression: float,
    friction: float,
    options: ClosingOptions | None = None,
) -> Closed:
    back = back_condition("slide_compression", model.points, MESH.back_quads(), along_kpa_per_mm=MU / 35.0)
    closing = Closing(
        model,
        skin.contact_quads,
        back,
        edge_p_mm=-8.0,
        friction=friction if skin.shear_passes else 0.0,
        options=options,
        parts=skin.parts,
        extra_nodes=skin.extra_nodes,
    )
    return closing.close((1.0 - compression) * closing.uncompressed_mm)


def _over_sheet(adherent: bool) -> tuple[SkinInterface, np.ndarray, int]:
    """A sheet on a sheet: interface, nodes, number of the lower sheet's nodes."""
    points, quads = sheet(4)
    both = np.concatenate([points, points])
    return skin_interface(both, quads, quads + len(points), 30.0, 0.3, adherent=adherent), both, len(points)


def test_none_brings_nothing() -> None:
    skin = skin_model("none", _model(), MESH.skin_quads())
    assert skin.parts == ()
    assert skin.extra_nodes is None
    np.testing.assert_array_equal(skin.contact_quads, MESH.skin_quads())


def test_unknown_model_is_refused() -> None:
    with pytest.raises(ValueError, match="'glued'"):
        skin_model("glued", _model(), MESH.skin_quads())  # type: ignore[arg-type]


def test_attached_is_a_membrane_on_the_bodys_nodes() -> None:
    skin = skin_model("attached", _model(), MESH.skin_quads())
    (membrane,) = skin.parts
    assert skin.extra_nodes is None
    assert membrane.dofs.max() < 3 * len(MESH.points)


def test_enclosing_membrane_shares_the_rim_of_the_back_only() -> None:
    skin = skin_model("adherent", _model(), MESH.skin_quads())
    rim = np.intersect1d(MESH.back_nodes(), MESH.skin_nodes())
    np.testing.assert_array_equal(rim_nodes(MESH.skin_quads()), rim)
    assert skin.extra_nodes is not None
    assert len(skin.extra_nodes) == len(MESH.skin_nodes()) - len(rim)
    np.testing.assert_array_equal(np.intersect1d(skin.contact_quads, np.arange(len(MESH.points))), rim)


@pytest.mark.parametrize("name", ["attached", "sliding", "adherent"])
def test_skin_at_rest_and_moved_rigidly_bears_nothing(name) -> None:
    skin = skin_model(name, _model(), MESH.skin_quads())
    extra = np.empty((0, 3)) if skin.extra_nodes is None else skin.extra_nodes
    points = np.concatenate([MESH.points, extra])
    moved = points @ rotation((1.0, 0.4, -2.0), 0.8).T + [4.0, 9.0, -2.0]
    for positions in (points, moved):
        for part in skin.parts:
            assert np.abs(part.renewed(positions).terms(positions)[0]).max() < 1e-9


@pytest.mark.parametrize("adherent", [False, True])
def test_interface_stiffness_and_force_are_derivatives_of_the_energy(adherent) -> None:
    interface, points, count = _over_sheet(adherent)
    rng = np.random.default_rng(6)
    lifted = points.copy()
    lifted[count:] += rng.normal(scale=0.05, size=(count, 3))
    interface = interface.renewed(lifted)
    positions = lifted + rng.normal(scale=0.2, size=points.shape)
    assert_energy_force_and_stiffness_agree(interface, positions, 1e-4)


def test_sliding_interface_bears_pressure_and_neither_shear_nor_more_than_a_trace_of_pull() -> None:
    interface, points, count = _over_sheet(adherent=False)
    force = {}
    inner = (points[count:, :2] < 35.0).all(axis=1)
    for name, shift in {"pressed": [0, 0, -0.5], "lifted": [0, 0, 0.5], "slid": [3.0, 2.0, 0.0]}.items():
        positions = points.copy()
        positions[count:] += np.array(shift, dtype=float)
        force[name] = assembled(interface.renewed(positions), positions)[0].reshape(-1, 3)[count:]
    assert force["pressed"].sum(axis=0)[2] == pytest.approx(-30.0 * 0.45 * 1600.0, rel=2e-3)
    assert 0.0 < force["lifted"].sum(axis=0)[2] < 3e-3 * 30.0 * 0.5 * 1600.0
    np.testing.assert_allclose(force["slid"][inner], 0.0, atol=1e-9)


def test_adherent_interface_holds_against_slip_until_it_is_lifted_off() -> None:
    interface, points, count = _over_sheet(adherent=True)
    slid, lifted = points.copy(), points.copy()
    slid[count:, 0] += 2.0
    lifted[count:, 2] += 1.0
    held = assembled(interface.renewed(slid), slid)[0].reshape(-1, 3)[count:].sum(axis=0)
    assert held[0] == pytest.approx(30.0 * 2.0 * 1600.0)
    free = interface.renewed(lifted)
    assert not free.stuck.any()
    slid[count:, 2] += 1.0
    loose = assembled(free, slid)[0].reshape(-1, 3)[count:].sum(axis=0)
    assert abs(loose[0]) < 1e-4 * held[0]


def test_projection_finds_known_feet_on_a_round_surface() -> None:
    points, quads = tube(24, 6, 40.0, 60.0)
    surface = QuadSurface(quads)
    face, shape = surface.faces_of(np.arange(30, 60))
    np.testing.assert_allclose(np.einsum("ma,mai->mi", shape, points[surface.quads[face]]), points[30:60])
    angle, height = np.linspace(0.2, 5.9, 40), np.linspace(8.0, 52.0, 40)
    outside = np.column_stack([43.0 * np.cos(angle), 43.0 * np.sin(angle), height])
    near = np.array([np.argmin(np.linalg.norm(points[quads].mean(axis=1) - p, axis=1)) for p in outside])
    start = surface.around[near, -2]
    foot = surface.project(outside, points, start)
    found = np.einsum("ma,mai->mi", foot.shape, points[quads[foot.face]])
    sagitta = 40.0 * (1.0 - np.cos(np.pi / 24))
    apart = outside - found
    assert (np.abs((apart * foot.normal).sum(axis=1) - 3.0 - 0.5 * sagitta) < 0.5 * sagitta + 1e-6).all()
    np.testing.assert_allclose(np.cross(apart, foot.normal), 0.0, atol=1e-8)
    np.testing.assert_allclose(found[:, 2], height, atol=1e-8)


def test_skin_stretched_over_a_cylinder_presses_with_tension_over_radius() -> None:
    around, along, radius, stretch, thickness = 48, 4, 30.0, 1.2, 1.5
    body, quads = tube(around, along, radius, 20.0)
    slack, _ = tube(around, along, radius / stretch, 20.0)
    points = np.concatenate([body, slack])
    law = TensionLinear(10.0)
    membrane = Membrane(points, quads + len(body), law, thickness)
    interface = skin_interface(points, quads, quads + len(body), 500.0, law.mu_kpa, adherent=False)
    turn = rotation((0.0, 0.0, 1.0), 0.3 * 2.0 * np.pi / around)
    start = np.concatenate([body, 1.001 * body @ turn.T * [1, 1, 0] + body * [0, 0, 1]])
    free = np.zeros(points.shape, dtype=bool)
    free[len(body) :, :2] = True
    positions, (_, settled) = relaxed((membrane, interface.renewed(start)), start, free)
    blocks = settled.terms(positions)[0].reshape(-1, 5, 3)
    pressing = np.linalg.norm(blocks[:, 1:].sum(axis=1), axis=1).reshape(along + 1, around)[1:-1]
    # Held in length: sigma = 2 W' (l^2 - l^-2), thickness h / l.
    slope = float(law.slope_kpa(np.array(stretch**2 + 1.0 + stretch**-2)))
    tension = 2.0 * slope * (stretch**2 - stretch**-2) * thickness / stretch
    area = 2.0 * np.pi * radius / around * 20.0 / along
    np.testing.assert_allclose(pressing / area, tension / radius, rtol=0.02)


@pytest.mark.parametrize("name", ["attached", "sliding", "adherent"])
@pytest.mark.parametrize("compression", [0.21, 0.5])
def test_breast_with_skin_comes_to_rest_between_plates_with_friction(name, compression) -> None:
    model = _model()
    skin = skin_model(name, model, MESH.skin_quads())
    closed = _closed(model, skin, compression, 0.46)
    assert closed.restless_mm < 0.1
    assert closed.force_n[0] == pytest.approx(closed.force_n[1], rel=0.02)
    assert closed.min_det_f > 0.4
    assert closed.iterations < 90
    assert closed.cuts == 0
    if name != "attached":
        interface = closed.state.parts[1]
        gap = interface.gap_mm(closed.state.positions)
        assert gap.min() > -0.3
        assert gap.max() < 0.5


def test_skin_of_no_thickness_changes_nothing() -> None:
    bare, thin = (
        _closed(_model(), skin_model(name, _model(), MESH.skin_quads(), thickness_mm=0.0), 0.35, 0.3)
        for name in ("none", "attached")
    )
    np.testing.assert_allclose(thin.deformed, bare.deformed, atol=1e-6)


def test_attached_skin_stiffens_the_breast() -> None:
    forces = [
        _closed(_model(), skin_model("attached", _model(), MESH.skin_quads(), thickness_mm=h), 0.35, 0.0).force_n[0]
        for h in (0.0, 1.5, 3.0)
    ]
    assert forces[0] < forces[1] < forces[2]


def test_adherent_skin_on_a_stiff_interface_is_attached_skin() -> None:
    attached = _closed(_model(), skin_model("attached", _model(), MESH.skin_quads()), 0.35, 0.0)
    apart, force = [], []
    for stiffness in (40.0, 4000.0):
        skin = skin_model("adherent", _model(), MESH.skin_quads(), pressed_per_mm=stiffness)
        adherent = _closed(_model(), skin, 0.35, 0.0)
        apart.append(np.linalg.norm(adherent.deformed - attached.deformed, axis=1).max())
        force.append(adherent.force_n[0] / attached.force_n[0])
    assert apart[0] < 0.5
    assert apart[1] < 0.03
    np.testing.assert_allclose(force, [1.0, 1.0], rtol=0.015)


def test_attached_skin_pulls_on_a_body_whose_ends_are_prescribed() -> None:
    mesh = block(3)
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(MU, 0.495))
    ends = np.abs(np.abs(mesh.points[:, 2]) - 30.0) < 1e-9
    nodes, targets = np.flatnonzero(ends), mesh.points[ends] * [1.0, 1.0, 1.3]
    skin = skin_model("attached", model, mesh.skin_quads())
    bare, clad = (solve_prescribed(model, nodes, targets, parts=parts) for parts in ((), skin.parts))
    assert clad.iterations <= bare.iterations + 3
    assert np.linalg.norm(clad.deformed - bare.deformed, axis=1).max() > 0.1


def test_mirrored_breast_has_mirrored_skin() -> None:
    grid = MESH.node_grid()
    mirror = np.empty(len(MESH.points), dtype=np.int64)
    mirror[grid.ravel()] = grid[::-1].ravel()
    model = _model()
    flipped = replace(MESH, points=MESH.points[mirror] * [-1.0, 1.0, 1.0])
    other = HyperelasticModel(flipped.points, flipped.hexes(), neo_hookean(MU, 0.495))
    one = _closed(model, skin_model("sliding", model, MESH.skin_quads()), 0.35, 0.0)
    two = _closed(other, skin_model("sliding", other, flipped.skin_quads()), 0.35, 0.0)
    np.testing.assert_allclose(two.deformed[mirror] * [-1.0, 1.0, 1.0], one.deformed, atol=0.05)


def test_sliding_skin_at_rest_is_in_equilibrium_by_itself() -> None:
    model = _model()
    skin = skin_model("sliding", model, MESH.skin_quads())
    closed = _closed(model, skin, 0.35, 0.0, ClosingOptions(tolerance_mm=0.002, rests=40))
    membrane, interface = closed.state.parts
    positions, count = closed.state.positions, len(MESH.points)
    pulled, pressed = (assembled(part, positions)[0].reshape(-1, 3)[count:] for part in (membrane, interface))
    scale = np.linalg.norm(pulled, axis=1).max()
    assert np.linalg.norm(pulled + pressed, axis=1).max() < 0.1 * scale
    across = pressed - (pressed * interface.normal).sum(axis=1, keepdims=True) * interface.normal
    assert np.linalg.norm(across, axis=1).max() < 1e-6 * scale
