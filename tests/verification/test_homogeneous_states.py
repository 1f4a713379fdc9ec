"""Uniaxial, equibiaxial and simple shear against closed forms, one element and several."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.materials.catalogue import CATALOGUE
from mammoreg.materials.elastic import ElasticMaterial, hyperelastic, neo_hookean
from mammoreg.materials.exponential import Exponential
from mammoreg.materials.hardening import HardenedFat
from mammoreg.materials.linear import Linear
from mammoreg.materials.tabulated import Tabulated
from mammoreg.materials.uniaxial import UniaxialLaw
from tests.verification.closed_forms import Slope, equibiaxial, simple_shear, slope_of_uniaxial, uniaxial
from tests.verification.equilibria import Solved, on, solve
from tests.verification.hex_bodies import Floats, Indices, brick, shaken

MU = 9.4


@dataclass(frozen=True)
class Law:
    """A law as this test writes it, and the project's material of a Poisson's ratio."""

    slope: Slope
    material: Callable[[float], ElasticMaterial]


def uniaxial_law(stress_kpa: Callable[[float], float], law: UniaxialLaw) -> Law:
    """A law by its one-dimensional formula, the project's beside it."""
    return Law(slope_of_uniaxial(stress_kpa), lambda poisson: hyperelastic(law, poisson))


def exponential(b: float, m: float) -> Callable[[float], float]:
    return lambda e: b / m * math.expm1(m * e)


def hardened(e: float) -> float:
    """Azar's fat as the catalogue assumes it: ligaments from 21 % on."""
    return exponential(4.46, 7.4)(e) + exponential(4.46, 12.3)(max(e - 0.21, 0.0))


AZAR_FAT = CATALOGUE["azar"].fat.law
assert isinstance(AZAR_FAT, HardenedFat)
LAWS = {
    "neo-Hookean": Law(lambda i1: 0.5 * MU, lambda poisson: neo_hookean(MU, poisson)),
    "Wellman's fat": uniaxial_law(exponential(4.46, 7.4), Exponential(4.46, 7.4)),
    "Wellman's gland": uniaxial_law(exponential(15.1, 12.3), Exponential(15.1, 12.3)),
    "Azar's fat": uniaxial_law(hardened, AZAR_FAT),
    "Krouskop's gland": uniaxial_law(exponential(20.65, 6.09), Exponential(20.65, 6.09)),
    "Bakic's gland": uniaxial_law(lambda e: 60.0 * e, Linear(60.0)),
    "a table": uniaxial_law(lambda e: 30.0 * e, Tabulated((0.1, 0.3, 0.6), (3.0, 9.0, 18.0))),
    "Lorenzen's fat": uniaxial_law(lambda e: 1.7 * e, Linear(1.7)),
}
bodies = pytest.mark.parametrize("several", [False, True], ids=["one element", "27 distorted elements"])
laws = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
ratios = pytest.mark.parametrize("poisson", [0.49, 0.4999])


def cube(several: bool) -> tuple[Floats, Indices]:
    points, hexes = brick((3, 3, 3) if several else (1, 1, 1))
    return shaken(points, 0.06), hexes


def stretched(model: HyperelasticModel, moved: dict[int, float]) -> Solved:
    """The unit cube with three faces in planes of symmetry and others moved to stretches, the rest of it free."""
    points = model.points
    held = np.stack([on(points, axis, 0.0) for axis in range(3)], axis=1)
    targets = points.copy()
    for axis, stretch in moved.items():
        held[on(points, axis, 1.0), axis] = True
        targets[:, axis] *= stretch
    return solve(model, held, targets, steps=8)


def force(model: HyperelasticModel, solved: Solved, axis: int) -> Floats:
    """Force on the face across an axis, over its undeformed area 1."""
    return np.asarray(solved.reaction[on(model.points, axis, 1.0)].sum(axis=0))


def bulk(model: HyperelasticModel) -> float:
    return float(model.material.bulk_kpa[0])


@laws
@bodies
@ratios
@pytest.mark.parametrize("stretch", [0.55, 0.79, 1.3])
def test_uniaxial(law: Law, several: bool, poisson: float, stretch: float) -> None:
    model = HyperelasticModel(*cube(several), law.material(poisson))
    side, stress = uniaxial(stretch, law.slope, bulk(model))
    solved = stretched(model, {2: stretch})
    np.testing.assert_allclose(solved.deformed, model.points * [side, side, stretch], atol=1e-8)
    assert force(model, solved, 2)[2] == pytest.approx(stress, rel=1e-7)


@laws
@bodies
@ratios
@pytest.mark.parametrize("stretch", [0.8, 1.3])
def test_equibiaxial(law: Law, several: bool, poisson: float, stretch: float) -> None:
    model = HyperelasticModel(*cube(several), law.material(poisson))
    thick, stress = equibiaxial(stretch, law.slope, bulk(model))
    solved = stretched(model, {0: stretch, 1: stretch})
    np.testing.assert_allclose(solved.deformed, model.points * [stretch, stretch, thick], atol=1e-8)
    assert force(model, solved, 0)[0] == pytest.approx(stress, rel=1e-7)


@laws
@bodies
@ratios
def test_simple_shear(law: Law, several: bool, poisson: float) -> None:
    amount = 0.6
    model = HyperelasticModel(*cube(several), law.material(poisson))
    outside: NDArray[np.bool_] = ((model.points < 1e-9) | (model.points > 1.0 - 1e-9)).any(axis=1)
    held = np.repeat(outside[:, None], 3, axis=1)
    targets = model.points + amount * model.points[:, 1:2] * [1.0, 0.0, 0.0]
    solved = solve(model, held, targets, steps=2)
    np.testing.assert_allclose(solved.deformed, targets, atol=1e-9)
    nominal = nominal_shear_force(model, solved)
    np.testing.assert_allclose(nominal, simple_shear(amount, law.slope), atol=1e-7 * MU)


@bodies
@pytest.mark.parametrize("stiffening", [0.0, 1.5])
def test_fibres_along_a_stretch(several: bool, stiffening: float) -> None:
    """Holzapfel, Gasser and Ogden 2000 (J. Elasticity 61): W4 = k1 / (2 k2) (exp(k2 (I4bar - 1)^2) - 1), in tension."""
    fibre_kpa, stretch = 25.0, 1.3
    material = neo_hookean(MU, 0.49, np.array([0.0, 0.0, 1.0]), fibre_kpa, stiffening)
    model = HyperelasticModel(*cube(several), material)

    def stresses(side: float) -> Floats:
        squares = np.array([side, side, stretch]) ** 2 / (side**2 * stretch) ** (2.0 / 3.0)
        beyond = squares[2] - 1.0
        tension = 2.0 * fibre_kpa * beyond * math.exp(stiffening * beyond**2) * squares[2]
        deviator = MU * (squares - squares.mean()) + tension * np.array([-1.0, -1.0, 2.0]) / 3.0
        det = side**2 * stretch
        return np.asarray(deviator + bulk(model) * (det - 1.0) * det)

    side = brentq(lambda width: float(stresses(width)[0]), 0.6, 1.2, xtol=1e-14)
    solved = stretched(model, {2: stretch})
    np.testing.assert_allclose(solved.deformed, model.points * [side, side, stretch], atol=1e-8)
    assert force(model, solved, 2)[2] == pytest.approx(stresses(side)[2] / stretch, rel=1e-7)


def nominal_shear_force(model: HyperelasticModel, solved: Solved) -> Floats:
    """Force on the face y = 1: that of its nodes without the share that the faces x = 0, 1 and z = 0, 1 hold there.

    By virtual work: the nodes' forces times a virtual displacement y in each direction give the stress on y.
    """
    return np.asarray((solved.reaction * model.points[:, 1:2]).sum(axis=0))
