"""Plates that stand as a part of a body whose skin is prescribed."""

from dataclasses import replace

import numpy as np
import pytest

from mammoreg.contact.soft import SoftContact
from mammoreg.contact.surface import ContactSurface
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import held_back
from mammoreg.fem.parts.gravity import gravity
from mammoreg.fem.parts.part import Part
from mammoreg.fem.parts.standing_plates import StandingPlates
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.fem.plates.standing import standing_plates
from mammoreg.fem.prescribed.solve import solve_prescribed
from mammoreg.materials.elastic import neo_hookean
from tests.unit.fe_bodies import block

MESH = block(4)
MODEL = HyperelasticModel(MESH.points, MESH.hexes(), neo_hookean(10.0, 0.49))
QUADS = np.concatenate([MESH.skin_quads(), MESH.back_quads()])
BACK = held_back(MESH.back_nodes(), np.array([False, True, False]))
HARD = ClosingOptions(penalty_per_mm=100.0, band_mm=0.05, contact_factors=(), tolerance_mm=0.002)


def _closed(friction: float):
    closing = Closing(MODEL, QUADS, BACK, friction=friction, options=HARD)
    return closing, closing.close(48.0)


def _plates(closing, closed) -> StandingPlates:
    return standing_plates(closing, QUADS, closed.gap_mm, closed.state.height, closed.state.memory)


def test_terms_are_derivatives_of_the_energy() -> None:
    closing, closed = _closed(0.3)
    plates, rng = _plates(closing, closed), np.random.default_rng(3)
    assert isinstance(plates, Part)
    positions, way = (
        closed.deformed + rng.normal(0.0, 0.03, closed.deformed.shape),
        rng.normal(size=(len(MESH.points), 3)),
    )
    at = [plates.terms(positions + step * way) for step in (-1e-5, 0.0, 1e-5)]
    spread = way.ravel()[plates.dofs]
    slope = float(np.sum(at[1][0] * spread))
    energies = [1e3 * plates.energy_mj(positions + step * way) for step in (-1e-5, 1e-5)]
    assert slope == pytest.approx((energies[1] - energies[0]) / 2e-5, rel=1e-4)
    bent = np.einsum("fij,fj->fi", at[1][1], spread)
    np.testing.assert_allclose(bent, (at[2][0] - at[0][0]) / 2e-5, atol=1e-3 * np.abs(bent).max())


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_interior_between_plates_stays_where_the_closing_left_it(friction: float) -> None:
    """Only the lower half's skin is prescribed; the upper plate holds the rest, and both press as they did."""
    closing, closed = _closed(friction)
    plates = _plates(closing, closed)
    nodes = np.unique(MESH.skin_quads())
    nodes = nodes[MESH.points[nodes, 2] < 0.0]
    solved = solve_prescribed(
        MODEL,
        nodes,
        closed.deformed[nodes],
        BACK,
        start=closed.deformed,
        pressure=closed.state.pressure,
        parts=[plates.beside(nodes)],
    )
    assert np.abs(solved.deformed - closed.deformed).max() < 0.02
    force = plates.force_n(solved.deformed, solved.node_reaction_n, nodes)
    assert force == pytest.approx(closed.force_n, rel=0.005)
    free = solve_prescribed(MODEL, nodes, closed.deformed[nodes], BACK, start=closed.deformed)
    assert np.abs(free.deformed - closed.deformed).max() > 3.0, "without the plate the upper half springs back"
    assert plates.penetration_mm(free.deformed) > 3.0 > 0.1 > plates.penetration_mm(solved.deformed)


def test_faces_that_are_wholly_prescribed_are_left_to_the_reaction() -> None:
    closing, closed = _closed(0.3)
    plates = _plates(closing, closed)
    back = MESH.back_nodes()
    skin = np.union1d(MESH.skin_nodes(), back[MESH.points[back, 2] > 10.0])
    beside = plates.beside(skin)
    quads = beside.contact.surface.quads
    assert len(quads) == 12, "all faces of the back but its uppermost row"
    assert not np.isin(quads, skin).all(axis=1).any()
    assert beside.memory.anchor.shape == (2, len(quads), 9, 3)
    kept = [i for i, quad in enumerate(QUADS) if not np.isin(quad, skin).all()]
    np.testing.assert_array_equal(beside.memory.pressure, plates.memory.pressure[:, kept])


def test_a_part_of_the_contact_is_the_contact_of_a_part() -> None:
    surface = ContactSurface(MESH.points, QUADS)
    contact, mask = SoftContact(surface, 3.0), np.arange(len(QUADS)) % 3 == 0
    part, alone = contact.part(mask).surface, ContactSurface(MESH.points, QUADS[mask])
    np.testing.assert_array_equal(part.area, alone.area)
    np.testing.assert_array_equal(part.positions(MESH.points), alone.positions(MESH.points))


def test_a_body_that_has_left_the_plates_is_no_breast_between_them() -> None:
    """Its weight draws the block back by the 38 mm that weak springs let it, out of plates that reach 20 mm over it."""
    stiffness = np.tile(5.0 * np.eye(3), (len(MESH.back_nodes()), 1, 1))
    weak = replace(held_back(MESH.back_nodes(), np.zeros(3, dtype=bool)), springs=stiffness)
    options = ClosingOptions(steps=2)
    for density, stays in ((1.0, True), (2200.0, False)):
        load = gravity(MODEL, density, np.array([0.0, 1.0, 0.0]))
        closing = Closing(MODEL, QUADS, weak, edge_p_mm=-10.0, lip_radius_mm=2.0, options=options, parts=[load])
        if stays:
            assert closing.close(58.0).force_n[0] > 0.1
        else:
            with pytest.raises(NotConvergedError, match="has left the plates"):
                closing.close(58.0)
