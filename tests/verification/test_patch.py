"""Patch tests: distorted hexahedra reproduce a constant strain, small or large, compressible or nearly not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.materials.elastic import ElasticMaterial, bulk_ratio, neo_hookean
from tests.verification.equilibria import face_forces, solve
from tests.verification.febio import boundary_faces
from tests.verification.hex_bodies import Floats, Indices, brick, shaken

LARGE = np.array([[1.25, 0.3, -0.1], [0.1, 0.8, 0.2], [0.0, -0.15, 1.1]])
INNER = np.array(
    [
        [0.249, 0.342, 0.192],
        [0.826, 0.288, 0.288],
        [0.850, 0.649, 0.263],
        [0.273, 0.750, 0.230],
        [0.320, 0.186, 0.643],
        [0.677, 0.305, 0.683],
        [0.788, 0.693, 0.644],
        [0.165, 0.745, 0.702],
    ]
)


def macneal_harder() -> tuple[Floats, Indices]:
    """Seven hexahedra in a unit cube (MacNeal and Harder 1985, Finite Elem. Anal. Des. 1, figure 2)."""
    outer, _ = brick((1, 1, 1))
    cube = outer[[0, 1, 3, 2, 4, 5, 7, 6]]
    inside, around = np.arange(8, 16), np.arange(8)
    faces = np.array([[0, 1, 2, 3], [5, 4, 7, 6], [1, 0, 4, 5], [2, 1, 5, 6], [3, 2, 6, 7], [0, 3, 7, 4]])
    shells = [np.concatenate([around[face], inside[face]]) for face in faces]
    return np.concatenate([cube, INNER]), np.stack([inside, *shells])


def surface(points: Floats) -> NDArray[np.bool_]:
    """Which points (N, 3) lie on the unit cube's surface."""
    return np.asarray(((points < 1e-9) | (points > 1.0 - 1e-9)).any(axis=1))


def stresses(model: HyperelasticModel, deformed: Floats, pressure: Floats) -> Floats:
    """Cauchy stress (E, Q, 6), Voigt 11 22 33 12 23 31, kPa."""
    state = model.state(deformed)
    stress = state.deviator / state.det[..., None]
    stress[..., :3] += pressure[:, None, None]
    return stress


def test_macneal_and_harders_patch_has_their_stress() -> None:
    """E = 1e6, nu = 0.25, u = 1e-3 (2x + y + z, x + 2y + z, x + y + 2z) / 2: 2000 normal, 400 shear (their table 3).

    The strain is scaled down by 100: the finite-strain law is linear there to 1e-5.
    """
    points, hexes = macneal_harder()
    young, poisson, scale = 1e6, 0.25, 1e-2
    model = HyperelasticModel(points, hexes, neo_hookean(young / (2.0 * (1.0 + poisson)), poisson))
    gradient = np.eye(3) + scale * 0.5e-3 * (np.ones((3, 3)) + np.eye(3))
    held = np.repeat(surface(points)[:, None], 3, axis=1)
    solved = solve(model, held, points @ gradient.T, options=NewtonOptions(1e-8, 1e-9))
    np.testing.assert_allclose(solved.deformed, points @ gradient.T, atol=1e-14)
    stress = stresses(model, solved.deformed, solved.pressure) / scale
    np.testing.assert_allclose(stress, np.broadcast_to([2000.0] * 3 + [400.0] * 3, stress.shape), rtol=1e-4)


@pytest.mark.parametrize("poisson", [0.3, 0.49, 0.4999])
def test_held_surface_gives_a_large_constant_strain_inside(poisson: float) -> None:
    points, hexes = brick((3, 4, 3))
    points = shaken(points, 0.08)
    gradient = LARGE / np.cbrt(np.linalg.det(LARGE)) * (1.0 + 0.1 * (0.5 - poisson))
    model = HyperelasticModel(points, hexes, neo_hookean(10.0, poisson))
    held = np.repeat(surface(points)[:, None], 3, axis=1)
    solved = solve(model, held, points @ gradient.T, steps=2)
    np.testing.assert_allclose(solved.deformed, points @ gradient.T, atol=1e-11)
    np.testing.assert_allclose(solved.pressure, solved.pressure.mean(), atol=1e-7)


def nominal_stress(gradient: Floats, mu: float, bulk: float) -> Floats:
    """First Piola-Kirchhoff stress of W = mu/2 (I1bar - 3) + K/2 (J - 1)^2, written down here."""
    det, inverse = np.linalg.det(gradient), np.linalg.inv(gradient).T
    isochoric = mu * det ** (-2.0 / 3.0) * (gradient - (gradient**2).sum() / 3.0 * inverse)
    return np.asarray(isochoric + bulk * (det - 1.0) * det * inverse)


@pytest.mark.parametrize("poisson", [0.3, 0.49, 0.4999])
def test_tractions_of_a_large_constant_strain_give_it_back(poisson: float) -> None:
    """Only rigid motion is held; the loads are the closed form's along a straight path of the strain."""
    points, hexes = brick((3, 3, 3))
    points = shaken(points, 0.08)
    mu, bulk = 10.0, 10.0 * bulk_ratio(poisson)
    quads = boundary_faces(hexes)
    middle = points[quads].mean(axis=1) - 0.5
    normal = np.where(np.abs(middle) > 0.5 - 1e-9, np.sign(middle), 0.0)
    held = np.zeros(points.shape, dtype=bool)
    origin, along_x, along_y = (np.linalg.norm(points - p, axis=1).argmin() for p in (np.zeros(3), *np.eye(3)[:2]))
    held[origin], held[along_x, 1:], held[along_y, 2] = True, True, True
    model = HyperelasticModel(points, hexes, ElasticMaterial(np.array(mu), np.array(bulk)))
    solved = None
    for share in np.linspace(0.125, 1.0, 8):
        gradient = np.eye(3) + share * (np.array([[1.2, 0.25, -0.1], [0.0, 0.9, 0.15], [0.0, 0.0, 1.0]]) - np.eye(3))
        gradient[2, 2] = (1.0 + 0.1 * share * (0.5 - poisson)) / np.linalg.det(gradient)
        load = face_forces(points, quads, normal @ nominal_stress(gradient, mu, bulk).T)
        solved = solve(model, held, points @ gradient.T, [load], start=solved)
        np.testing.assert_allclose(solved.deformed, points @ gradient.T, atol=1e-8)
        assert np.abs(solved.reaction[held]).max() < 1e-6
