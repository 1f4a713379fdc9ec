"""CalculiX's neo-Hookean beam (deck beamnh.inp of Debian's calculix-ccx-test) side by side with the program itself.

Its law is ours: W = C10 (I1bar - 3) + (J - 1)^2 / D1, C10 = 1.92505, D1 = 0.026, hence mu = 2 C10 and K = 2 / D1.
"""

from pathlib import Path

import numpy as np
import pytest

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.materials.elastic import ElasticMaterial
from tests.verification.calculix import Deck, read_deck, requires_ccx, run_ccx
from tests.verification.closed_forms import uniaxial
from tests.verification.equilibria import on, solve
from tests.verification.hex_bodies import Floats, subdivided

pytestmark = requires_ccx("beamnh.inp")
MU, BULK, LENGTH, PULL = 2.0 * 1.92505, 2.0 / 0.026, 8.0, 2.0
MATERIAL = ElasticMaterial(np.array(MU), np.array(BULK))


@pytest.fixture(scope="module")
def deck() -> Deck:
    return read_deck("beamnh.inp")


def test_pulled_beam_is_that_of_calculix(deck: Deck, tmp_path: Path) -> None:
    """The deck, converged further than by its defaults: a follower traction of 2 pulls the free end.

    Both elements hold its uniform strain exactly. The beam is pulled here to CalculiX's length; its width must follow
    to the printed digits, and the traction to 2e-4: CalculiX takes the area that it acts on from the iteration before.
    """
    displacement = run_ccx(deck.text.replace("*DLOAD", "*CONTROLS,PARAMETERS=FIELD\n1e-9,1e-9\n*DLOAD"), tmp_path)
    corners = np.unique(deck.hexes)
    points, hexes = deck.points[corners], np.searchsorted(corners, deck.hexes)
    theirs = points + displacement[corners]
    model = HyperelasticModel(points, hexes, MATERIAL)
    end = on(points, 2, LENGTH)
    held = np.zeros(points.shape, dtype=bool)
    held[on(points, 2, 0.0) | end, 2] = True
    held[deck.numbers[corners] == 1, :2] = held[deck.numbers[corners] == 2, 1] = True
    targets = points.copy()
    targets[end, 2] = theirs[end, 2].mean()
    solved = solve(model, held, targets, steps=4)
    np.testing.assert_allclose(solved.deformed, theirs, atol=1e-6 * LENGTH)
    side, _ = uniaxial(targets[end, 2][0] / LENGTH, lambda i1: 0.5 * MU, BULK)
    assert solved.reaction[end, 2].sum() == pytest.approx(PULL * side**2, rel=2e-4)


def clamped(deck: Deck, push: Floats) -> str:
    """The deck with both ends glued and the free one displaced, without its traction."""
    head, tail = deck.text.split("*BOUNDARY\n")[0], deck.text[deck.text.index("*ELSET,ELSET=EALL") :]
    material = tail[: tail.index("*STEP")]
    imposed = "".join(f"GIBO,{axis + 1},{axis + 1},{value}\n" for axis, value in enumerate(push))
    step = "*STEP,NLGEOM\n*STATIC\n0.1,1.\n*BOUNDARY\n" + imposed + "*NODE PRINT,NSET=NALL\nU\n*END STEP\n"
    return head + "*BOUNDARY\nCN7,1,3\n" + material + step


@pytest.mark.parametrize("push", [(2.0, 0.0, -0.3), (0.0, 0.0, 3.0)], ids=["bent", "stretched"])
def test_clamped_beam_is_close_to_that_of_calculix(deck: Deck, tmp_path: Path, push: tuple[float, ...]) -> None:
    """Both ends glued: C3D20R (reduced, quadratic) against our linear hexahedra with constant pressure, refined.

    Ours are cut to a quarter of CalculiX's size, where they are converged to 0.2 % of the push; the rest of the
    1 % allowed is CalculiX's own coarse mesh, two elements across, at the glued ends.
    """
    motion = np.array(push)
    displacement = run_ccx(clamped(deck, motion), tmp_path)
    corners = np.unique(deck.hexes)
    worst = []
    for pieces in (2, 4):
        points, hexes = subdivided(deck.points, deck.hexes, pieces)
        end = on(points, 2, LENGTH)
        held = np.repeat((on(points, 2, 0.0) | end)[:, None], 3, axis=1)
        model = HyperelasticModel(points, hexes, MATERIAL)
        solved = solve(model, held, points + end[:, None] * motion, steps=6, options=NewtonOptions(1e-7, 1e-6))
        same = np.linalg.norm(points[None] - deck.points[corners][:, None], axis=-1).argmin(axis=1)
        difference = solved.deformed[same] - points[same] - displacement[corners]
        worst.append(float(np.abs(difference).max() / np.linalg.norm(motion)))
    assert max(worst) < 0.01
