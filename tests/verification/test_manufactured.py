"""Manufactured solutions at finite strain: second order in the displacement, first in its gradient and the pressure.

The body force is minus the divergence of the nominal stress of the chosen deformation. Both are written here; the
deformation is differentiated by complex steps (Squire and Trapp 1998, SIAM Review 40), exact to rounding, its stress by
central differences of sixth order.
"""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.materials.elastic import bulk_ratio, neo_hookean
from mammoreg.meshing.trilinear import GAUSS_POINTS, jacobians, shape_functions, shape_gradients
from tests.verification.equilibria import DeadForces, solve
from tests.verification.hex_bodies import Floats, Indices, brick, shaken

Complex = NDArray[np.complex128]
Deformation = Callable[[Complex], Complex]
MU, STEP = 10.0, 1e-30
GAUSS, GAUSS_WEIGHTS = np.array([-(0.6**0.5), 0.0, 0.6**0.5]), np.array([5.0, 8.0, 5.0]) / 9.0
LOCAL = np.stack(np.meshgrid(GAUSS, GAUSS, GAUSS, indexing="ij"), axis=-1).reshape(-1, 3)
WEIGHT = np.einsum("i,j,k->ijk", GAUSS_WEIGHTS, GAUSS_WEIGHTS, GAUSS_WEIGHTS).ravel()


def sheared(place: Complex) -> Complex:
    """Two shears one after the other: every volume is kept, so that the pressure is zero for any bulk modulus."""
    x, y, z = np.moveaxis(place, -1, 0)
    y = y + 0.15 * np.sin(np.pi * z)
    return np.stack([x + 0.2 * np.sin(np.pi * y), y, z], axis=-1)


def swollen(place: Complex) -> Complex:
    """Shears with changes of volume of up to a third."""
    x, y, z = np.moveaxis(place, -1, 0)
    return np.stack(
        [x + 0.1 * np.sin(np.pi * x) * y + 0.1 * z**2, y + 0.1 * np.sin(np.pi * z), z + 0.08 * np.cos(np.pi * x) * z],
        axis=-1,
    )


def slopes(function: Callable[[Complex], Complex], place: Complex) -> Complex:
    """Derivatives (..., k, 3) of a field of `place` (..., 3), by complex steps; `function` gives (..., k)."""
    return np.stack([function(place + 1j * STEP * axis).imag / STEP for axis in np.eye(3)], axis=-1).astype(complex)


def gradient_of(deformation: Deformation, place: Floats) -> Floats:
    return slopes(deformation, place.astype(complex)).real


def nominal(gradient: Complex, bulk: float) -> Complex:
    """First Piola-Kirchhoff stress of mu/2 (I1bar - 3) + K/2 (J - 1)^2."""
    det = np.linalg.det(gradient)[..., None, None]
    inverse = np.linalg.inv(gradient).swapaxes(-1, -2)
    size = (gradient**2).sum(axis=(-1, -2))[..., None, None]
    return np.asarray(MU * det ** (-2.0 / 3.0) * (gradient - size / 3.0 * inverse) + bulk * (det - 1.0) * det * inverse)


def body_force(deformation: Deformation, bulk: float, place: Floats) -> Floats:
    """Force per undeformed volume (..., 3), mN/mm3, that keeps the deformation in equilibrium."""
    width, total = 2e-3, np.zeros(place.shape)
    for axis, direction in enumerate(np.eye(3)):
        for reach, factor in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
            for sign in (1.0, -1.0):
                moved = place + sign * reach * width * direction
                stress = nominal(gradient_of(deformation, moved).astype(complex), bulk).real
                total += sign * factor / width * stress[..., axis]
    return -total


def volume_forces(points: Floats, hexes: Indices, force: Callable[[Floats], Floats]) -> DeadForces:
    """Consistent nodal forces of a body force, by 2 x 2 x 2 Gauss points."""
    shape = shape_functions(GAUSS_POINTS)
    place = np.einsum("qa,eai->eqi", shape, points[hexes])
    weight = np.linalg.det(jacobians(points[hexes], GAUSS_POINTS))
    return DeadForces(hexes, np.einsum("qa,eq,eqi->eai", shape, weight, force(place)))


def errors(deformation: Deformation, poisson: float, elements: int) -> Floats:
    """L2 errors of displacement and gradient, and of the pressures at the elements' centres over the shear modulus."""
    points, hexes = brick((elements, elements, elements))
    points = shaken(points, 0.12 / elements)
    bulk = MU * bulk_ratio(poisson)
    load = volume_forces(points, hexes, lambda place: body_force(deformation, bulk, place))
    surface = ((points < 1e-9) | (points > 1.0 - 1e-9)).any(axis=1)
    model = HyperelasticModel(points, hexes, neo_hookean(MU, poisson))
    exact = deformation(points.astype(complex)).real
    solved = solve(model, np.repeat(surface[:, None], 3, axis=1), exact, [load], 2, NewtonOptions(1e-9, 1e-8))
    place, found = (
        np.einsum("qa,eai->eqi", shape_functions(LOCAL), nodes[hexes]) for nodes in (points, solved.deformed)
    )
    weight = np.linalg.det(jacobians(points[hexes], LOCAL)) * WEIGHT
    inverse = np.linalg.inv(jacobians(points[hexes], LOCAL))
    slope = np.einsum("eai,qac,eqcj->eqij", solved.deformed[hexes], shape_gradients(LOCAL), inverse)
    centre = points[hexes].mean(axis=1)
    pressure = bulk * (np.linalg.det(gradient_of(deformation, centre)) - 1.0)
    displacement = ((found - deformation(place.astype(complex)).real) ** 2).sum(axis=-1)
    gradient = ((slope - gradient_of(deformation, place)) ** 2).sum(axis=(-1, -2))
    hydrostatic = (weight.sum(axis=1) * (solved.pressure - pressure) ** 2).sum() / MU**2
    return np.sqrt(np.array([(weight * displacement).sum(), (weight * gradient).sum(), hydrostatic]))


@pytest.mark.parametrize(
    ("deformation", "poisson"),
    [(sheared, 0.3), (sheared, 0.49), (sheared, 0.4999), (swollen, 0.3)],
    ids=["sheared-0.3", "sheared-0.49", "sheared-0.4999", "swollen-0.3"],
)
def test_orders_of_convergence(deformation: Deformation, poisson: float) -> None:
    middle, fine = (errors(deformation, poisson, elements) for elements in (6, 12))
    displacement, gradient, pressure = np.log2(middle / fine)
    assert displacement == pytest.approx(2.0, abs=0.1)
    assert gradient == pytest.approx(1.0, abs=0.1)
    assert pressure > 0.9
