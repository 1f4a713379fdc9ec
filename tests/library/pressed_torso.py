"""A torso's MR volume, and mammograms of its right breast pressed by a tissue that the registration does not assume."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import closing_plates, place_breast
from mammoreg.fem.plates.closing import ClosingOptions
from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.localization.deformation import MeshDeformation, ReferenceMesh
from mammoreg.materials.attenuation import attenuation_map
from mammoreg.meshing.block import BlockMesh
from mammoreg.projection.cone_beam import project_volume
from tests.unit.torso_phantom import CHEST_P, RIGHT, torso

ELEMENTS, EDGE_P, PIXEL_MM, ROWS, COLUMNS = 6, CHEST_P - 6.0, 0.5, 460, 260
ANGLES = {"CC": 3.0, "MLO": 49.0, "ML": 87.0, "LM": -94.0, "LMO": -131.0, "FB": 183.0, "XCCL": 4.0}
GAPS = {"CC": 60.0, "MLO": 56.0, "ML": 58.0, "LM": 57.0, "LMO": 56.0, "FB": 60.0, "XCCL": 60.0}
MECHANICS = BreastMechanics(material="homogeneous", fibre_ratio=0.0, friction=0.2, back="slide_plane")
LESIONS = np.array([[-78.0, 14.0, 12.0], [-58.0, 24.0, -22.0], [-86.0, 30.0, -4.0]])
"""Places (3, 3) in the breast, LPS of the right one."""


def ball(n: int) -> BlockMesh:
    """The right breast by the map of a cube's half onto half a ball."""
    side = np.linspace(-1.0, 1.0, n + 1)
    k, j, i = np.meshgrid(np.linspace(0.0, 1.0, n + 1), side, side, indexing="ij")
    ii, jj, kk = i**2, j**2, k**2
    medial = i * np.sqrt(1.0 - jj / 2.0 - kk / 2.0 + jj * kk / 3.0)
    superior = j * np.sqrt(1.0 - ii / 2.0 - kk / 2.0 + ii * kk / 3.0)
    front = k * np.sqrt(1.0 - ii / 2.0 - jj / 2.0 + ii * jj / 3.0)
    (x, z), (a, depth, c) = RIGHT.centre, RIGHT.axes
    points = np.stack([x + a * medial, CHEST_P - depth * front, z + c * superior], axis=-1)
    return BlockMesh(n, points.reshape(-1, 3))


@dataclass(frozen=True)
class Truth:
    """A view of the pressed breast.

    Attributes:
        deformation: of the truth's own mesh.
        geometry: of the image.
        pixels: as a unit stores a right breast, chest wall at the right.
    """

    deformation: MeshDeformation
    geometry: ViewGeometry
    pixels: np.ndarray

    def shown(self, points: np.ndarray) -> np.ndarray:
        """Stored pixels (N, 2) as (column, row) of points (N, 3) of the MR volume."""
        pixels = self.geometry.project(self.deformation.forward(points))
        return np.stack([COLUMNS - 1 - pixels[:, 0], pixels[:, 1]], axis=-1)


@cache
def truth(view: str) -> Truth:
    mesh, angle = ball(ELEMENTS), ANGLES[view]
    breast = place_breast(mesh, angle, MECHANICS, 6.0)
    closed = closing_plates(breast, EDGE_P, MECHANICS, ClosingOptions(steps=6)).close(GAPS[view])
    nodes = closed.deformed
    middle = 0.5 * float(nodes[:, 0].min() + nodes[:, 0].max()) + 4.0
    geometry = ViewGeometry(angle, EDGE_P, middle, closed.height_mm, GAPS[view], 650.0, 15.0, PIXEL_MM, ROWS, COLUMNS)
    deformation = MeshDeformation(ReferenceMesh(mesh.points, mesh.hexes()), nodes)
    return Truth(deformation, geometry, _mammogram(deformation, geometry)[:, ::-1])


def _mammogram(deformation: MeshDeformation, geometry: ViewGeometry) -> np.ndarray:
    spacing = 1.6
    low, high = deformation.deformed.min(axis=0) - 3.0, deformation.deformed.max(axis=0) + 3.0
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    source = deformation.inverse(grid.reshape(-1, 3))
    inside = np.isfinite(source).all(axis=1)
    source = np.where(inside[:, None], source, 0.0)
    gland = (RIGHT.radius(source) < 0.6) & (source[:, 1] < CHEST_P - 12.0)
    tissue = np.where(inside, np.where(gland, 2, 1), 0)
    volume = Volume(attenuation_map(tissue).reshape(grid.shape[:3]), low, np.full(3, spacing), "plate")
    return np.clip(8000.0 * project_volume(volume, geometry, 1), 0, 65535).astype(np.uint16)


def mr() -> Volume:
    """The torso's MR volume, LPS."""
    return torso()
