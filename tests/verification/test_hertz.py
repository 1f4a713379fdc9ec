"""Contact against Hertz: a slightly curved layer on a rigid base, pressed by a plate.

Hertz 1881: F = 4/3 E* sqrt(R) d^1.5, E* = E / (1 - nu^2), and the pressure in the middle is 3 F / (2 pi a^2) with
a^2 = R d. A layer of thickness h that is bonded to its base is stiffer by a series in chi = sqrt(R d) / h (Dimitriadis
et al. 2002, Biophys. J. 82, equation 9, for a sphere pressed into a layer, which is the same contact at small strain).
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import held_back
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.materials.elastic import neo_hookean
from tests.verification.equilibria import on
from tests.verification.febio import boundary_faces
from tests.verification.hex_bodies import Floats, brick

MU, RADIUS, THICK, WIDTH = 10.0, 500.0, 80.0, 200.0
DEPTH, ELEMENTS, SMALLEST = 0.05, 13, 0.9
STIFF = ClosingOptions(
    steps=2,
    tolerance_mm=1e-5,
    damping=1e-9,
    rests=2,
    contact_factors=(),
    penalty_per_mm=2000.0,
    band_mm=1e-4,
    rule="nodes",
)


@dataclass(frozen=True)
class Pressed:
    """Force of the whole contact, N, and distances from its middle, mm, and pressures, kPa, of its points."""

    force_n: float
    distance: Floats
    pressure: Floats


def hertz_force(poisson: float, depth: float) -> float:
    """N; Hertz's formula times the series of a bonded layer."""
    young = 2.0 * MU * (1.0 + poisson)
    force = 4.0 / 3.0 * young / (1.0 - poisson**2) * RADIUS**0.5 * depth**1.5
    alpha = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson**2) / (1.0 - poisson)
    beta = (0.6387 - 1.0277 * poisson + 1.5164 * poisson**2) / (1.0 - poisson)
    chi = (RADIUS * depth) ** 0.5 / THICK
    series = (
        1.0
        - 2.0 * alpha / np.pi * chi
        + 4.0 * alpha**2 / np.pi**2 * chi**2
        - 8.0 / np.pi**3 * (alpha**3 + 4.0 * np.pi**2 / 15.0 * beta) * chi**3
        + 16.0 * alpha / np.pi**4 * (alpha**3 + 3.0 * np.pi**2 / 5.0 * beta) * chi**4
    )
    return float(1e-3 * force * series)


def graded(unit: Floats, size: float) -> Floats:
    """Equal steps (N,) in [0, 1] spread over a size so that the first becomes the smallest and all grow alike."""
    step = 1.0 / ELEMENTS
    rate = float(brentq(lambda r: size * np.expm1(r * step) / np.expm1(r) - SMALLEST, 1e-3, 40.0))
    return np.asarray(size * np.expm1(rate * unit) / np.expm1(rate))


def curved(unit: Floats) -> Floats:
    """A quarter of a layer whose upper side is the paraboloid z = h - r^2 / 2R."""
    x, y, below = graded(unit[:, 0], WIDTH), graded(unit[:, 1], WIDTH), graded(1.0 - unit[:, 2], THICK)
    share = 1.0 - below / THICK
    return np.stack([x, y, share * (THICK - (x**2 + y**2) / (2.0 * RADIUS))], axis=1)


@cache
def pressed(poisson: float, depth: float, options: ClosingOptions) -> Pressed:
    """The layer on its glued base, its planes of symmetry held, its far sides free."""
    points, hexes = brick((ELEMENTS, ELEMENTS, ELEMENTS), curved)
    base = on(points, 2, 0.0)
    held = np.stack([on(points, 0, 0.0) | base, on(points, 1, 0.0) | base, base], axis=1)
    nodes, quads = np.flatnonzero(held.any(axis=1)), boundary_faces(hexes)
    top = len(points) - (ELEMENTS + 1) ** 2
    # The base lies on the lower plate, which does nothing to it.
    touching = quads[(quads >= top).all(axis=1) | base[quads].all(axis=1)]
    model = HyperelasticModel(points, hexes, neo_hookean(MU, poisson))
    closing = Closing(model, touching, held_back(nodes, held[nodes]), options=options, lower_mm=0.0)
    closed = closing.close(THICK - depth)
    state, contact = closed.state, closing.contact
    terms = contact.terms(state.positions, state.height, closing.plates(THICK - depth), state.memory)
    place = contact.surface.positions(points).reshape(-1, 3)
    above = place[:, 2] > 0.5 * THICK
    distance = np.linalg.norm(place[above, :2], axis=1)
    return Pressed(4.0 * closed.force_n[1], distance, terms.pressure[1].ravel()[above])


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_force_and_pressure(poisson: float) -> None:
    found, radius = pressed(poisson, DEPTH, STIFF), (RADIUS * DEPTH) ** 0.5
    expected = hertz_force(poisson, DEPTH)
    assert found.force_n == pytest.approx(expected, rel=0.015)
    highest = 3e3 * expected / (2.0 * np.pi * radius**2)
    ellipse = highest * np.sqrt(np.maximum(1.0 - (found.distance / radius) ** 2, 0.0))
    inner = found.distance < 0.6 * radius
    assert np.abs(found.pressure - ellipse)[inner].max() < 0.08 * highest
    assert found.distance[found.pressure > 0.0].max() == pytest.approx(radius, abs=SMALLEST)


def test_force_grows_with_the_power_of_three_halves() -> None:
    shallow, deep = (pressed(0.3, depth, STIFF).force_n / hertz_force(0.3, depth) for depth in (DEPTH, 1.6 * DEPTH))
    assert shallow == pytest.approx(deep, rel=0.025)


@pytest.mark.slow
def test_augmentation_takes_back_what_a_soft_contact_lets_in() -> None:
    """A barrier 2000 times softer, in which the middle would lie a third of the depth behind the plate."""
    soft = replace(STIFF, penalty_per_mm=1.0, band_mm=1e-3)
    plain, augmented, stiff = (
        pressed(0.3, DEPTH, options).force_n
        for options in (soft, replace(soft, augmentations=30, penetration_mm=2e-4), STIFF)
    )
    assert plain < 0.8 * stiff
    assert augmented == pytest.approx(stiff, rel=0.01)
