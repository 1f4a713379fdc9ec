"""The paper's four models of skin (section II-D, Table IV) as parts of an equilibrium.

    none      no skin.
    attached  membrane elements on the body's own surface nodes.
    sliding   a membrane with nodes of its own that encloses the breast and slides on it without friction.
    adherent  the same membrane, which does not slip where it touches.

At the rim of the breast's back skin goes on over the chest: there the enclosing membrane shares the body's nodes.

Plates press on the skin that adheres. Skin that slides would be squeezed out from under them: where a coarse mesh
leaves a plate its surface is tilted, and no friction holds a thin membrane against the wedge of two pressures a
hundred times its own. There the pressure passes through the skin and the plates meet the tissue; their friction ends
in the skin, `shear_passes` is False, and the plates close on the tissue with friction 0.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.part import Part
from mammoreg.fem.skin.interface import skin_interface
from mammoreg.fem.skin.law import TensionLinear
from mammoreg.fem.skin.membrane import SKIN_THICKNESS_MM, Membrane
from mammoreg.materials.isochoric import IsochoricLaw

SkinName = Literal["none", "attached", "sliding", "adherent"]
PAPER_SKIN = TensionLinear()
PRESSED_PER_MM, RESTING_PER_MM = 40.0, 10.0
"""Stiffness of the interface, 1/mm: under plates in units of the body's mean shear modulus, else of the skin's."""


@dataclass(frozen=True)
class SkinModel:
    """What a skin adds to an equilibrium.

    Attributes:
        parts: membrane and interface.
        extra_nodes: undeformed nodes (M, 3) of a membrane of its own, mm, numbered behind the body's; None: no such.
        contact_quads: faces (F, 4) that meet the plates.
        shear_passes: whether the plates' friction acts on those faces; else they are to close with friction 0.
    """

    parts: tuple[Part, ...]
    extra_nodes: Floats | None
    contact_quads: Integers
    shear_passes: bool = True


def skin_model(
    name: SkinName,
    model: HyperelasticModel,
    skin_quads: NDArray[np.integer],
    law: IsochoricLaw = PAPER_SKIN,
    thickness_mm: float = SKIN_THICKNESS_MM,
    pressed_per_mm: float = PRESSED_PER_MM,
) -> SkinModel:
    """Skin of a body.

    Args:
        name: which of the four.
        model: the body, undeformed.
        skin_quads: faces (F, 4) of its surface, outward, without those of the back.
        law: of the skin; not looked at for `none`.
        thickness_mm: undeformed.
        pressed_per_mm: stiffness of the interface of an adherent skin, in units of the body's mean shear modulus.

    Raises:
        ValueError: no such model of skin.
    """
    quads = np.asarray(skin_quads, dtype=np.int64)
    if name == "none":
        return SkinModel((), None, quads)
    if name == "attached":
        return SkinModel((Membrane(model.points, quads, law, thickness_mm),), None, quads)
    if name not in ("sliding", "adherent"):
        raise ValueError(f"no model of skin is called {name!r}: none, attached, sliding or adherent")
    adherent = name == "adherent"
    own, under = _enclosing(quads, len(model.points))
    points = np.concatenate([model.points, model.points[under]])
    stiffness = RESTING_PER_MM * law.mu_kpa
    if adherent:
        stiffness = pressed_per_mm * model.mean_mu_kpa
    membrane = Membrane(points, own, law, thickness_mm)
    interface = skin_interface(points, quads, own, stiffness, law.mu_kpa, adherent=adherent)
    return SkinModel((membrane, interface), points[len(model.points) :], own if adherent else quads, adherent)


def rim_nodes(quads: Integers) -> Integers:
    """Nodes on edges that belong to one face only, ascending."""
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])


def _enclosing(quads: Integers, count: int) -> tuple[Integers, Integers]:
    """Faces of a skin with nodes of its own behind `count` others, and the body's nodes under these."""
    under = np.setdiff1d(quads, rim_nodes(quads))
    number = np.arange(count)
    number[under] = count + np.arange(len(under))
    return number[quads], under
