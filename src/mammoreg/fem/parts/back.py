"""Conditions at the back of the breast: held components and springs (Robin), and an extra displacement (pull)."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.geometry.quads import node_area_vectors

BackName = Literal["fixed", "slide_compression", "shear_layer", "slide_plane", "springs"]

NORMAL_STIFFNESS_KPA_PER_MM = 200.0
"""Holds the normal displacement of a sliding back to some hundredths of a millimetre."""
RESIDUAL_STIFFNESS_KPA_PER_MM = 1e-3
"""Tangential stiffness of a back that slides in its plane: removes the rigid motion only."""


@dataclass(frozen=True)
class BackCondition:
    """How the nodes of the back are held.

    Attributes:
        nodes: their numbers (B,).
        held: components prescribed (B, 3), in the plate frame.
        springs: stiffness per node (B, 3, 3), mN/mm, towards the undeformed place plus `pull_mm`.
        pull_mm: displacement (3,) of the held components and of the springs' anchors.
    """

    nodes: Integers
    held: NDArray[np.bool_]
    springs: Floats
    pull_mm: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def holds_height(self) -> bool:
        """Whether anything keeps the back from moving freely along the plates' direction."""
        return bool(self.held[:, 2].any() or self.springs[:, 2, 2].sum() > 1.0)


def held_back(nodes: NDArray[np.integer], held: NDArray[np.bool_], pull_mm: Floats | None = None) -> BackCondition:
    """Nodes whose components `held` ((3,) or (B, 3)) are prescribed."""
    pull = np.zeros(3) if pull_mm is None else np.asarray(pull_mm, dtype=float)
    spread = np.broadcast_to(held, (len(nodes), 3)).copy()
    return BackCondition(nodes.astype(np.int64), spread, np.zeros((len(nodes), 3, 3)), pull)


def back_condition(
    name: BackName,
    points: Floats,
    quads: NDArray[np.integer],
    tangential_kpa_per_mm: float = 0.05,
    pull_mm: Floats | None = None,
    along_kpa_per_mm: float = 0.0,
) -> BackCondition:
    """The back condition of a setting.

    Args:
        name: `fixed`; `slide_compression` (free along the plates' direction only); `shear_layer` (free along the
            plates' direction and along the chest wall, held across it); `slide_plane` (held along each node's own
            normal, free across it); `springs` (as `slide_plane`, with springs across the normal).
        points: undeformed nodes (N, 3) of the mesh, plate frame, mm.
        quads: faces (F, 4) of the back.
        tangential_kpa_per_mm: stiffness of `springs` per area.
        pull_mm: displacement (3,) imposed on the back.
        along_kpa_per_mm: stiffness per area against the sliding of `slide_compression` and `shear_layer`: the shear
            of the soft tissue between the model's back and the chest wall.
    """
    nodes = np.unique(quads)
    if name == "fixed":
        return held_back(nodes, np.array([True, True, True]), pull_mm)
    if name in ("slide_compression", "shear_layer"):
        slides = np.array([name == "shear_layer", False, True])
        held = held_back(nodes, ~slides, pull_mm)
        area = np.linalg.norm(node_area_vectors(points, np.asarray(quads, dtype=np.int64))[nodes], axis=1)
        held.springs[:] = along_kpa_per_mm * area[:, None, None] * np.diag(slides)
        return held
    tangential = tangential_kpa_per_mm if name == "springs" else RESIDUAL_STIFFNESS_KPA_PER_MM
    springs = _springs(points, np.asarray(quads, dtype=np.int64), nodes, tangential)
    pull = np.zeros(3) if pull_mm is None else np.asarray(pull_mm, dtype=float)
    return BackCondition(nodes, np.zeros((len(nodes), 3), dtype=bool), springs, pull)


def _springs(points: Floats, quads: Integers, nodes: Integers, tangential: float) -> Floats:
    """Stiffness (B, 3, 3) in mN/mm: stiff along the nodes' normals, `tangential` across, times their share of area."""
    area = node_area_vectors(points, quads)
    size = np.linalg.norm(area[nodes], axis=1)
    normal = area[nodes] / size[:, None]
    dyad = normal[:, :, None] * normal[:, None, :]
    across = tangential * (np.eye(3) - dyad)
    return np.asarray(size[:, None, None] * (NORMAL_STIFFNESS_KPA_PER_MM * dyad + across))
