"""Parametric breasts on a flat chest wall, meshed like a patient's."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mammoreg.geometry import Volume
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.breast import build_mesh

Floats = NDArray[np.float64]

SPACING_MM = 1.4
"""Voxels of a body's mask: those of the pipeline's working grid."""
_MARGIN_MM = 7.0
_ROUNDNESS = 2.2


@dataclass(frozen=True)
class Body:
    """Half a superellipsoid that may hang and may have a neck; breast frame, its back in the plane p = 0.

    Attributes:
        lateral_mm, depth_mm, height_mm: half axes along medial, from the back to the front, and along superior.
        drop_mm: how far the tip hangs below the base's middle.
        neck: share by which cross-sections are narrower at a seventh of the depth than the superellipsoid's.
    """

    lateral_mm: float
    depth_mm: float
    height_mm: float
    drop_mm: float = 0.0
    neck: float = 0.0

    def inside(self, points: Floats) -> NDArray[np.bool_]:
        """Whether points (..., 3), mm, lie in the body."""
        m, p, s = np.moveaxis(points, -1, 0)
        t = np.clip(-p / self.depth_mm, 0.0, None)
        width = 1.0 - self.neck * np.exp(-(((t - 0.15) / 0.15) ** 2))
        s = s + self.drop_mm * t**1.5
        across = np.abs(m / (self.lateral_mm * width)) ** _ROUNDNESS
        across += np.abs(s / (self.height_mm * width)) ** _ROUNDNESS
        return np.asarray((p < 0.0) & (across ** (2.0 / _ROUNDNESS) + t**_ROUNDNESS < 1.0))


BODIES: Mapping[str, Body] = {
    "small": Body(48.0, 48.0, 45.0),
    "pendulous": Body(58.0, 110.0, 52.0, drop_mm=40.0, neck=0.12),
    "flat": Body(78.0, 32.0, 62.0),
}
"""About 230, 680 and 350 cm3."""


@lru_cache(maxsize=16)
def body_mesh(name: str, elements: int) -> BlockMesh:
    """The mesh of a body of `BODIES`, made from a mask by the pipeline's own mesher.

    Args:
        name: of the body.
        elements: a side.
    """
    body = BODIES[name]
    reach = np.array([body.lateral_mm, body.depth_mm, body.height_mm + body.drop_mm]) + _MARGIN_MM
    low, high = -reach, np.array([reach[0], _MARGIN_MM, reach[2]])
    axes = [np.arange(a, b, SPACING_MM) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    mask = Volume(body.inside(grid).astype(np.uint8), low, np.full(3, SPACING_MM))
    across = np.arange(-reach.max(), reach.max(), 1.5 * SPACING_MM)
    m, s = np.meshgrid(across, across, indexing="ij")
    back = np.stack([m, np.zeros_like(m), s], axis=-1).reshape(-1, 3)
    back = back[body.inside(back - [0.0, SPACING_MM, 0.0])]
    return build_mesh(mask, back, np.array([0.0, -body.depth_mm, -body.drop_mm]), elements).mesh
