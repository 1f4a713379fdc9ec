"""Cook's membrane, nearly incompressible, plane strain by one layer of hexahedra: linear and at finite strain."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.linear_elastic import LinearElasticBody
from mammoreg.materials.elastic import ElasticMaterial, neo_hookean
from tests.verification.equilibria import DeadForces, face_forces, on, solve
from tests.verification.febio import boundary_faces
from tests.verification.hex_bodies import Floats, Indices, brick

LINEAR_MM = 16.432584376299037
OPENGEOSYS_MM = {10: 6.746283955378773, 20: 6.8589364838052315, 30: 6.891409184641067}


def membrane(elements: int) -> tuple[Floats, Indices]:
    """A trapezoid (0, 0), (48, 44), (48, 60), (0, 44) mm, one element of unit thickness across."""

    def tapered(unit: Floats) -> Floats:
        x, share = 48.0 * unit[:, 0], unit[:, 1]
        low, high = 44.0 * unit[:, 0], 44.0 + 16.0 * unit[:, 0]
        return np.stack([x, low + share * (high - low), unit[:, 2]], axis=1)

    return brick((elements, elements, 1), tapered)


def clamped(elements: int, material: ElasticMaterial) -> tuple[HyperelasticModel, NDArray[np.bool_], DeadForces]:
    """The membrane, what of it is held, and a force of 1 mN upwards spread over its free end."""
    points, hexes = membrane(elements)
    held = np.zeros(points.shape, dtype=bool)
    held[:, 2] = True
    held[on(points, 0, 0.0)] = True
    quads = boundary_faces(hexes)
    end = quads[on(points, 0, 48.0)[quads].all(axis=1)]
    return HyperelasticModel(points, hexes, material), held, face_forces(points, end, np.array([0.0, 1.0 / 16.0, 0.0]))


def raised(elements: int, material: ElasticMaterial, force: float, steps: int) -> tuple[Floats, Floats]:
    """Nodes and displacements (N, 3) at finite strain."""
    model, held, load = clamped(elements, material)
    solved = solve(model, held, model.points, [load.scaled(force)], steps, NewtonOptions(1e-8, 1e-4))
    return model.points, solved.deformed - model.points


def raised_a_little(elements: int, material: ElasticMaterial) -> tuple[Floats, Floats]:
    """Nodes and displacements (N, 3) of linear elasticity under a force of 1 mN."""
    model, held, load = clamped(elements, material)
    nodal = np.zeros(model.points.shape)
    np.add.at(nodal, load.nodes, load.force)
    return model.points, LinearElasticBody(model, held).solve(force=nodal).displacement


def at(points: Floats, displacement: Floats, height: float) -> float:
    """Vertical displacement, mm, at a height of the free end."""
    node = np.linalg.norm(points - [48.0, height, 0.0], axis=1).argmin()
    return float(displacement[node, 1])


def test_linear_membrane_converges_to_the_extrapolated_value() -> None:
    """lambda = 7500, G = 0.375 (nu = 0.499975), force 1: 16.4326 at (48, 52).

    P. Krysl, FAESOR/FinEALE, Cook_3D_strain.m: nodally integrated continuum elements (NICE-T6) with Richardson's
    extrapolation.
    """
    lame, mu = 7500.0, 0.375
    material = ElasticMaterial(np.array(mu), np.array(lame + 2.0 * mu / 3.0))
    found = np.array([at(*raised_a_little(n, material), 52.0) for n in (4, 8, 16, 32, 64)])
    assert at(*raised(8, material, 1e-5, 1), 52.0) == pytest.approx(1e-5 * found[1], rel=1e-4)
    short = LINEAR_MM - found
    assert short[0] < 0.15 * LINEAR_MM
    assert (short[:-1] / short[1:] > 2.5).all()
    assert 0.0 < short[-1] < 0.002 * LINEAR_MM


def test_large_membrane_is_that_of_opengeosys() -> None:
    """W = G/2 (I1bar - 3) + K/2 (J - 1)^2, E = 240.565, nu = 0.499, force 100: corner (48, 60) rises by 6.9 mm.

    OpenGeoSys 6, Tests/Data/LargeDeformation/CooksMembrane/CooksMembraneFbar.py: F-bar quadrilaterals, 4 to 30 a side,
    after de Souza Neto et al. 1996 and Elguedj et al. 2008. Another element on the same mesh: the answers meet with
    refinement.
    """
    material = neo_hookean(240.565 / (2.0 * 1.499), 0.499)
    found = {n: at(*raised(n, material, 100.0, 4), 60.0) for n in OPENGEOSYS_MM}
    for elements, tolerance in ((10, 0.006), (20, 0.0015), (30, 0.001)):
        assert found[elements] == pytest.approx(OPENGEOSYS_MM[elements], rel=tolerance)
    assert found[10] < found[20] < found[30]
