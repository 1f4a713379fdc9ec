"""The subdivided breast between planes against FEBio's forces and iterations (febio_scaling.csv beside its meshes)."""

import csv
from dataclasses import dataclass

import numpy as np
import pytest

from mammoreg.fem.parts.back import held_back
from mammoreg.fem.plates.closing import Closed
from tests.shared_data import DATA, requires_shared
from tests.verification.febio import HalfEllipsoid, boundary_faces, half_ellipsoid
from tests.verification.hex_bodies import subdivided
from tests.verification.test_breast_between_planes import LARGE_STEPS, PRECISE, close

pytestmark = requires_shared("fe")


@dataclass(frozen=True)
class Reference:
    """FEBio's answer: Newton iterations, load steps and force, N."""

    iterations: int
    steps: int
    force_n: float


def febio(elements: int, percent: int) -> Reference:
    with (DATA / "fe/febio_scaling.csv").open() as file:
        for row in csv.DictReader(file):
            if (int(row["elements"]), round(100 * float(row["compression"]))) == (elements, percent):
                return Reference(int(row["newton_iterations"]), int(row["load_steps"]), float(row["force_n"]))
    raise LookupError(f"febio_scaling.csv has no row for {elements} elements at {percent} %")


def fine(pieces: int) -> HalfEllipsoid:
    """The 7 x 7 x 7 mesh with every hexahedron cut; chest and core stand on the cut faces of the coarse ones."""
    coarse = half_ellipsoid(7)
    points, hexes = subdivided(coarse.points, coarse.hexes, pieces)
    faces = boundary_faces(hexes)
    behind = np.abs(points[faces][..., 1]).max(axis=1) < 1e-6
    chest = np.unique(faces[behind])
    core = coarse.points[coarse.held.nodes[coarse.held.held.all(axis=1)]]
    low, high = core.min(axis=0) - 1e-6, core.max(axis=0) + 1e-6
    held = np.zeros((len(chest), 3), dtype=bool)
    held[:, 1] = True
    held[((points[chest] >= low) & (points[chest] <= high)).all(axis=1)] = True
    return HalfEllipsoid(points, hexes, faces[~behind], faces[behind], held_back(chest, held), {})


def closed(body: HalfEllipsoid, percent: int) -> Closed:
    return close(body, percent, 0.49, LARGE_STEPS)


def test_cut_once_the_mesh_is_the_coarse_one() -> None:
    coarse, cut = half_ellipsoid(7), fine(1)
    assert len(cut.points) == len(coarse.points)
    assert cut.held.held.sum() == coarse.held.held.sum()
    again, plain = closed(cut, 21), closed(coarse, 21)
    assert again.force_n == pytest.approx(plain.force_n, rel=1e-9)


@pytest.mark.parametrize("percent", [21, 50])
@pytest.mark.parametrize("pieces", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_forces_of_the_subdivided_mesh_are_those_of_febio(pieces: int, percent: int) -> None:
    found = closed(fine(pieces), percent)
    reference = febio(7 * pieces, percent)
    assert found.force_n == pytest.approx((reference.force_n, reference.force_n), rel=0.01)
    assert found.iterations < reference.iterations


def test_iterations_are_fewer_than_those_of_febio() -> None:
    body = half_ellipsoid(7)
    for percent in (21, 50):
        found, reference = closed(body, percent), febio(7, percent)
        assert found.force_n[0] == pytest.approx(reference.force_n, rel=0.01)
        assert found.iterations <= 0.5 * reference.iterations


def test_twice_as_fine_transfinite_mesh_at_half_height() -> None:
    """FEBio's nodes pass its planes by up to 0.1 mm; its mesh has negative corner Jacobians there (design note)."""
    body = half_ellipsoid(14)
    found = close(body, 50, 0.49, PRECISE)
    difference = np.abs(found.deformed - body.points - body.displacement[50])
    assert difference.max() < 0.1
