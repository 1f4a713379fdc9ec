"""Contact points on the quadrilateral faces of a body's skin."""

from copy import copy
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers

Rule = Literal["nodes", "simpson", "gauss2", "gauss3"]

_LINE_RULES: dict[str, tuple[Floats, Floats]] = {
    "nodes": (np.array([-1.0, 1.0]), np.array([1.0, 1.0])),
    "simpson": (np.array([-1.0, 0.0, 1.0]), np.array([1.0, 4.0, 1.0]) / 3.0),
    "gauss2": (np.array([-1.0, 1.0]) / 3.0**0.5, np.array([1.0, 1.0])),
    "gauss3": (np.array([-(0.6**0.5), 0.0, 0.6**0.5]), np.array([5.0, 8.0, 5.0]) / 9.0),
}


class ContactSurface:
    """Quadrature points on bilinear faces.

    Args:
        points: undeformed nodes (N, 3), mm.
        quads: corners of the faces (F, 4), cyclic.
        rule: points per face; the closed rules (nodes, simpson) hold the corners too.

    Attributes:
        shape: shape functions at the points of a face, (q, 4).
        area: undeformed area of each point, (F, q), mm2.
    """

    def __init__(self, points: Floats, quads: NDArray[np.integer], rule: Rule = "simpson") -> None:
        self.quads: Integers = np.array(quads, dtype=np.int64)
        place, weight = _LINE_RULES[rule]
        r, s = (g.ravel() for g in np.meshgrid(place, place, indexing="ij"))
        corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
        along, across = 1.0 + corner[:, 0] * r[:, None], 1.0 + corner[:, 1] * s[:, None]
        self.shape: Floats = 0.25 * along * across
        slopes = np.stack([0.25 * corner[:, 0] * across, 0.25 * corner[:, 1] * along])
        tangents = np.einsum("dqa,fai->dfqi", slopes, np.asarray(points, dtype=float)[self.quads])
        size = np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=-1)
        self.area: Floats = size * np.outer(weight, weight).ravel()

    def part(self, faces: NDArray[np.bool_]) -> "ContactSurface":
        """The faces that a mask (F,) selects."""
        other = copy(self)
        other.quads, other.area = self.quads[faces], self.area[faces]
        return other

    def positions(self, nodes: Floats) -> Floats:
        """Contact points (F, q, 3) of nodes (N, 3)."""
        return np.asarray(np.einsum("qa,fai->fqi", self.shape, nodes[self.quads]))
