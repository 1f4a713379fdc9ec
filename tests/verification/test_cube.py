"""The paper's cube of 240 cm3 at 50 %: sliding faces against the closed form, glued ones against FEBio and FElupe."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mammoreg.fem.boundary import held_back
from mammoreg.fem.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.model import HyperelasticModel
from mammoreg.fem.prescribed import solve_prescribed
from mammoreg.materials.cube import CUBE_MM3, cube_force_n
from mammoreg.materials.elastic import bulk_ratio, neo_hookean
from mammoreg.materials.laws import NeoHookean
from tests.unit.fe_bodies import block

SIDE = CUBE_MM3 ** (1.0 / 3.0)


def uniaxial_force_n(mu_kpa: float, poisson: float, stretch: float) -> float:
    """Closed form: side faces free, isochoric split with K/2 (J - 1)^2."""
    bulk = mu_kpa * bulk_ratio(poisson)

    def lateral_stress(side: float) -> float:
        det = side**2 * stretch
        deviator = mu_kpa * det ** (-2.0 / 3.0) * (side**2 - (2.0 * side**2 + stretch**2) / 3.0)
        return float(deviator + bulk * (det - 1.0) * det)

    side = brentq(lateral_stress, 0.5, 3.0)
    det = side**2 * stretch
    deviator = mu_kpa * det ** (-2.0 / 3.0) * (stretch**2 - (2.0 * side**2 + stretch**2) / 3.0)
    return float(-(deviator + bulk * (det - 1.0) * det) / stretch * SIDE**2) * 1e-3


def squeezed_by_plates(poisson: float, friction: float, options: ClosingOptions) -> Closed:
    """The cube between plates, free to spread about its middle column."""
    mesh = block(4, (SIDE, SIDE, SIDE))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, poisson))
    column = np.flatnonzero((np.abs(mesh.points[:, :2]) < 1e-6).all(axis=1))
    side = np.flatnonzero((np.abs(mesh.points[:, 1]) < 1e-6) & (mesh.points[:, 0] > 0.49 * SIDE))
    nodes = np.concatenate([column, side])
    held = np.repeat([[True, True, False], [False, True, False]], [len(column), len(side)], axis=0)
    back = held_back(nodes, held)
    return Closing(model, mesh.skin_quads(), back, friction=friction, options=options).close(0.5 * SIDE)


@pytest.mark.parametrize(("poisson", "febio_n"), [(0.49, 134.404), (0.499, 135.093)])
def test_sliding_faces_give_the_closed_form(poisson: float, febio_n: float) -> None:
    expected = uniaxial_force_n(10.0, poisson, 0.5)
    assert expected == pytest.approx(febio_n, abs=0.001)
    closed = squeezed_by_plates(poisson, 0.0, ClosingOptions(penalty_per_mm=200.0, band_mm=0.02, stiffening=()))
    assert closed.force_n == pytest.approx((expected, expected), rel=0.005)


def test_nearly_incompressible_closed_form_is_the_one_dimensional_law() -> None:
    assert uniaxial_force_n(10.0, 0.49999, 0.5) == pytest.approx(cube_force_n(NeoHookean(10.0), 0.5), rel=1e-4)


def glued_force_n(elements: int) -> float:
    """Force on the upper face when both keep their shape."""
    mesh = block(elements, (SIDE, SIDE, SIDE))
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(10.0, 0.49))
    faces = np.abs(mesh.points[:, 2]) > 0.499 * SIDE
    nodes = np.flatnonzero(faces & (mesh.points[:, 2] > 0.0))
    below = held_back(np.flatnonzero(faces & (mesh.points[:, 2] < 0.0)), np.ones(3, dtype=bool))
    result = solve_prescribed(model, nodes, mesh.points[nodes] - np.array([0.0, 0.0, 0.5 * SIDE]), below)
    return float(-result.reaction_n[2])


def test_glued_faces_give_the_force_of_other_programs() -> None:
    assert glued_force_n(7) == pytest.approx(153.890, abs=0.005)


def test_friction_spans_from_sliding_to_glued() -> None:
    options = ClosingOptions()
    sliding, rough, sticking = (squeezed_by_plates(0.49, friction, options) for friction in (0.0, 0.1, 2.0))
    assert sliding.force_n[0] < rough.force_n[0] < sticking.force_n[0] < glued_force_n(4)
    points = block(4, (SIDE, SIDE, SIDE)).points
    above = points[:, 2] > 0.499 * SIDE
    spread = [np.abs((closed.deformed - points)[above, :2]).max() for closed in (sliding, rough, sticking)]
    assert spread[0] == pytest.approx(0.5 * SIDE * (np.sqrt(2.0) - 1.0), abs=0.6)
    assert spread[2] < 0.3 * spread[0]
