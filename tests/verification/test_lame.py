"""Thick cylinder and thick sphere: Lamé's small displacements, and a sphere blown up to twice its inside."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.linear_elastic import LinearElasticBody
from mammoreg.materials.elastic import ElasticMaterial, bulk_ratio, hyperelastic, neo_hookean
from mammoreg.materials.exponential import Exponential
from tests.verification.closed_forms import Slope, slope_of_uniaxial, sphere_pressure
from tests.verification.equilibria import on, solve
from tests.verification.hex_bodies import Floats, Indices, brick, spherical_shell

INNER, OUTER = 20.0, 40.0
MU = 10.0


def displaced(
    model: HyperelasticModel, held: NDArray[np.bool_], targets: Floats, linear: bool
) -> tuple[Floats, Floats]:
    """Displacements (N, 3), mm, and the forces (N, 3), mN, that hold the nodes: linear, or finite strains as small."""
    if linear:
        small = LinearElasticBody(model, held).solve(targets - model.points)
        return small.displacement, small.reaction
    solved = solve(model, held, targets, options=NewtonOptions(1e-8, 1e-8))
    return solved.deformed - model.points, solved.reaction


def root_mean_square(vectors: Floats) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def quarter_cylinder(around: int, layers: int) -> tuple[Floats, Indices]:
    """A quarter of a cylinder about z, one element high."""

    def bent(unit: Floats) -> Floats:
        radius, angle = INNER + (OUTER - INNER) * unit[:, 0], 0.5 * np.pi * unit[:, 1]
        height = (OUTER - INNER) / layers * unit[:, 2]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)

    return brick((layers, around, 1), bent)


def errors_in_a_cylinder(poisson: float, layers: int, linear: bool) -> tuple[float, float]:
    """Errors of displacement (root mean square over the inner one) and of inner pressure (relative).

    Plane strain (Timoshenko and Goodier, Theory of Elasticity, 1970, article 28): u = A r + B / r with a free outside,
    2 (lambda + mu) A = 2 mu B / b^2, and p = 2 mu B (1 / a^2 - 1 / b^2).
    """
    points, hexes = quarter_cylinder(2 * layers, layers)
    moved = 1e-5 * INNER
    lame = MU * (bulk_ratio(poisson) - 2.0 / 3.0)
    ratio = MU / ((lame + MU) * OUTER**2)
    b = moved / (1.0 / INNER + ratio * INNER)
    radius = np.linalg.norm(points[:, :2], axis=1)
    expected = points[:, :2] * (b * (1.0 / radius**2 + ratio))[:, None]
    inside = np.abs(radius - INNER) < 1e-9
    held = np.stack([on(points, 0, 0.0) | inside, on(points, 1, 0.0) | inside, np.ones(len(points), bool)], axis=1)
    targets = points.copy()
    targets[inside, :2] *= 1.0 + moved / INNER
    model = HyperelasticModel(points, hexes, neo_hookean(MU, poisson))
    displacement, reaction = displaced(model, held, targets, linear)
    error = root_mean_square(displacement[:, :2] - expected) / moved
    # Forces on the inside work on the radial motion there; the nodes in the planes of symmetry carry other forces.
    work = (reaction[inside, :2] * points[inside, :2] / INNER).sum()
    across = 0.5 * np.pi * INNER * points[:, 2].max()
    return error, float(abs(work / across / (2.0 * MU * b * (INNER**-2 - OUTER**-2)) - 1.0))


@pytest.mark.parametrize("linear", [True, False], ids=["linear", "finite strain"])
@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_cylinder_converges_to_lame(poisson: float, linear: bool) -> None:
    coarse, fine = (errors_in_a_cylinder(poisson, layers, linear) for layers in (6, 12))
    assert fine[0] < 1e-4
    assert fine[1] < 2e-4
    assert coarse[1] / fine[1] > 3.5


def sphere_errors(poisson: float, across: int, linear: bool) -> tuple[float, float]:
    """As for the cylinder; u = A r + B / r^2, 3 K A = 4 mu B / b^3, p = 4 mu B (1 / a^3 - 1 / b^3)."""
    points, hexes = spherical_shell(INNER, OUTER, across, across)
    moved = 1e-5 * INNER
    ratio = 4.0 / (3.0 * bulk_ratio(poisson) * OUTER**3)
    b = moved / (INNER**-2 + ratio * INNER)
    radius = np.linalg.norm(points, axis=1)
    expected = points * (b * (radius**-3 + ratio))[:, None]
    inside = np.abs(radius - INNER) < 1e-6
    held = np.repeat(inside[:, None], 3, axis=1)
    targets = points * (1.0 + moved / INNER * inside[:, None])
    model = HyperelasticModel(points, hexes, neo_hookean(MU, poisson))
    displacement, reaction = displaced(model, held, targets, linear)
    error = root_mean_square(displacement - expected) / moved
    force = (reaction[inside] * points[inside] / INNER).sum()
    pressure = force / (4.0 * np.pi * INNER**2)
    return error, float(abs(pressure / (4.0 * MU * b * (INNER**-3 - OUTER**-3)) - 1.0))


@pytest.mark.parametrize("linear", [True, False], ids=["linear", "finite strain"])
@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_sphere_converges_to_lame(poisson: float, linear: bool) -> None:
    coarse, fine = (sphere_errors(poisson, across, linear) for across in (4, 8))
    assert fine[0] < 1.1e-3
    assert fine[1] < 0.01
    assert coarse[0] / fine[0] > 3.5
    assert coarse[1] / fine[1] > 3.5


BLOWN: dict[str, tuple[Slope, ElasticMaterial]] = {
    "neo-Hookean": (lambda i1: 0.5 * MU, neo_hookean(MU, 0.49999)),
    "Wellman's fat": (
        slope_of_uniaxial(lambda e: 4.46 / 7.4 * np.expm1(7.4 * e)),
        hyperelastic(Exponential(4.46, 7.4), 0.49999),
    ),
}


def blown_up(material: ElasticMaterial, across: int, stretch: float) -> tuple[float, float]:
    """Largest error of the radii, mm, and inner pressure, kPa, of a sphere whose inside grows by a stretch."""
    points, hexes = spherical_shell(INNER, OUTER, across, across)
    radius = np.linalg.norm(points, axis=1)
    inside = np.abs(radius - INNER) < 1e-6
    targets = np.where(inside[:, None], points * stretch, points)
    model = HyperelasticModel(points, hexes, material)
    held = np.repeat(inside[:, None], 3, axis=1)
    solved = solve(model, held, targets, steps=4, options=NewtonOptions(1e-6, 1e-4))
    expected = np.cbrt(radius**3 + INNER**3 * (stretch**3 - 1.0))
    force = (solved.reaction[inside] * points[inside] / INNER).sum()
    error = np.abs(np.linalg.norm(solved.deformed, axis=1) - expected).max()
    return float(error), float(force / (4.0 * np.pi * (stretch * INNER) ** 2))


@pytest.mark.parametrize(("slope", "material"), BLOWN.values(), ids=BLOWN.keys())
def test_blown_up_sphere_has_the_incompressible_pressure(slope: Slope, material: ElasticMaterial) -> None:
    """The facets of the mesh make an error of second order: 2 % at 6 elements across, next to nothing extrapolated."""
    stretch = 1.6
    (_, coarse), (error, fine) = (blown_up(material, across, stretch) for across in (4, 6))
    expected = sphere_pressure(INNER, OUTER, stretch * INNER, slope)
    assert error < 0.005 * INNER
    assert fine == pytest.approx(expected, rel=0.03)
    assert (36.0 * fine - 16.0 * coarse) / 20.0 == pytest.approx(expected, rel=0.003)
