"""Digital patients: what is drawn by chance, from which ranges, and how images and truth are made of it.

The ranges, the rule that places lesions and the seeds were fixed before any registration ran on the cohort. They may
be made harder; no patient is drawn again for its result.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.random import Generator

from mammoreg.geometry import Volume, plate_to_breast
from mammoreg.imaging.views import PROJECTIONS
from mammoreg.imaging.views import View as Mammogram
from mammoreg.meshing.trilinear import volumes
from mammoreg.phantom.anatomy import Anatomy, Layers, Tissue, build_anatomy
from mammoreg.phantom.compression import Press, Pressed
from mammoreg.phantom.lesion import Lesion, LesionRule, draw_landmarks
from mammoreg.phantom.mechanics import Mechanics, Placement
from mammoreg.phantom.mesh import PhantomMesh, breast_mesh
from mammoreg.phantom.shape import Array, BreastShape, Torso
from mammoreg.phantom.warp import Deformed

View = Mammogram | Literal["3D"]
HEADER_ANGLE_DEG: dict[View, float] = {**{view: taken.angle_deg for view, taken in PROJECTIONS.items()}, "3D": 0.0}

TORSO = {"half_width": (180.0, 200.0), "half_depth": (115.0, 135.0), "tilt": (0.03, 0.12)}
VOLUME_CM3 = (250.0, 1000.0)
"""Of the tissue in front of the chest wall; reached by a factor on the lengths of `SCALED`."""
SCALED = ("length", "lateral", "medial", "inferior", "superior", "drop_m", "drop_s")
SHAPE = {
    "centre_m": (-90.0, -78.0),
    "centre_s": (-5.0, 5.0),
    "length": (80.0, 112.0),
    "lateral": (42.0, 54.0),
    "medial": (38.0, 50.0),
    "inferior": (46.0, 62.0),
    "superior": (52.0, 72.0),
    "drop_m": (-16.0, 0.0),
    "drop_s": (-20.0, -2.0),
    "slope": (0.10, 0.40),
    "taper": (0.0, 0.20),
    "roundness": (2.0, 2.6),
    "bluntness": (2.2, 3.2),
    "blend": (16.0, 24.0),
    "nipple_radius": (4.0, 5.5),
    "nipple_height": (6.0, 9.0),
    "back_lift": (7.0, 10.0),
}
LAYERS = {"skin": (1.3, 1.8), "fat": (12.0, 18.0), "muscle": (8.0, 13.0), "ribs": (8.0, 10.0)}
GLAND_SHARE = (0.12, 0.26)
MECHANICS = {
    "fat_kpa": (2.4, 3.6),
    "gland_ratio": (3.0, 5.0),
    "lesion_ratio": (6.0, 10.0),
    "skin_ratio": (9.0, 12.0),
    "poisson": (0.495, 0.497),
    "friction": (0.10, 0.25),
    "wall_normal_kpa_per_mm": (4.0, 8.0),
    "wall_tangential_kpa_per_mm": (0.3, 1.0),
    "lip_radius_mm": (10.0, 14.0),
    "fibre_ratio": (1.0, 3.0),
    "fibre_stiffening": (1.0, 4.0),
}
ROLL_DEG = (5.0, 8.0)
EDGE_MM = (6.0, 12.0)
PULL_MM = (4.0, 12.0)
LIFT = (0.3, 0.7)
FLAT, UPRIGHT = (0.46, 0.55), (0.42, 0.51)
SHARE: dict[View, tuple[float, float]] = {
    **{view: UPRIGHT if taken.upright else FLAT for view, taken in PROJECTIONS.items()},
    "3D": (0.21, 0.21),
}
LESION = LesionRule((8.0, 20.0), skin_mm=5.0, back_mm=20.0, nipple_mm=40.0, aside_mm=16.0, off_axis=(0.50, 0.90))
LANDMARKS = {"skin_mm": 6.0, "back_mm": 10.0, "apart_mm": 10.0}
MESH, COARSE = {"core": 8, "rows": 9, "shells": 3}, {"core": 4, "rows": 5, "shells": 1}
MARGIN_MM = np.array([30.0, 30.0, 28.0])
TORSO_DEPTH_MM = 75.0


def draw_each(ranges: dict[str, tuple[float, float]], random: Generator) -> dict[str, float]:
    """One number from each range."""
    return {name: float(random.uniform(*limits)) for name, limits in ranges.items()}


def draw_shape(random: Generator) -> BreastShape:
    """A breast of a drawn volume on its torso."""
    from scipy.optimize import brentq

    volume, torso, shape = float(random.uniform(*VOLUME_CM3)), draw_each(TORSO, random), draw_each(SHAPE, random)
    breast = BreastShape(torso=Torso(front_p=0.0, **torso), **shape)

    def excess(size: float) -> float:
        return volume_cm3(scaled(breast, size)) - volume

    return scaled(breast, float(brentq(excess, 0.3, 2.0, xtol=1e-4)))


def scaled(shape: BreastShape, size: float) -> BreastShape:
    """The shape with the lengths of `SCALED` times a factor."""
    return replace(shape, **{name: size * getattr(shape, name) for name in SCALED})


def volume_cm3(shape: BreastShape) -> float:
    """Volume in cm3 in front of the chest wall."""
    mesh = breast_mesh(shape, **COARSE)
    return float(volumes(mesh.points[mesh.hexes]).sum()) * 1e-3


@dataclass(frozen=True)
class Patient:
    """A drawn patient in the breast frame (a left breast looks like a right one here).

    Attributes:
        seed: of everything about this patient.
        shape, layers, gland_share, mechanics: what she is made of.
        lesion: None for a healthy volunteer.
        landmarks: points (N, 3), mm.
        placements: how she stands between the plates, by view.
    """

    seed: int
    shape: BreastShape
    layers: Layers
    gland_share: float
    mechanics: Mechanics
    lesion: Lesion | None
    landmarks: Array
    placements: dict[View, Placement]

    @classmethod
    def draw(cls, seed: int, views: Sequence[View], healthy: bool, landmarks: int) -> "Patient":
        """Draw a patient; each part has its own stream of numbers, so that one does not shift another."""
        body, inside, place = (np.random.default_rng([seed, stream]) for stream in range(3))
        shape, layers = draw_shape(body), Layers(**draw_each(LAYERS, body))
        gland_share, mechanics = float(body.uniform(*GLAND_SHARE)), Mechanics(**draw_each(MECHANICS, body))
        lesion = None if healthy else LESION.draw(shape, inside)
        points = draw_landmarks(shape, inside, landmarks, **LANDMARKS)
        placements = {view: draw_placement(shape, view, place) for view in views}
        return cls(seed, shape, layers, gland_share, mechanics, lesion, points, placements)

    def stream(self, name: int) -> Generator:
        """A stream of random numbers for images."""
        return np.random.default_rng([self.seed, 10 + name])

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) of what the MR volume shows of this side, mm."""
        shape = self.shape
        wide = np.array([1.4 * shape.lateral, 0.0, 1.1 * shape.inferior])
        lowest = np.array([shape.centre_m, shape.nipple[1], shape.centre_s]) - wide - MARGIN_MM
        back = shape.base_p + TORSO_DEPTH_MM
        return lowest, np.array([12.0, back, shape.centre_s + 1.1 * shape.superior + MARGIN_MM[2]])

    @cached_property
    def anatomy(self) -> Anatomy:
        """Tissue everywhere."""
        return build_anatomy(self.shape, self.layers, self.gland_share, self.lesion, self.box, self.stream(0))

    @cached_property
    def mesh(self) -> PhantomMesh:
        """The mesh of the truth's mechanics."""
        return breast_mesh(self.shape, **MESH)

    def pressed(self, view: View) -> tuple[Pressed, Deformed]:
        """The breast between the plates of a view.

        Raises:
            NotConvergedError: the plates did not come as far as wanted.
        """
        placement = self.placements[view]
        result = Press(self.anatomy, self.mesh, self.mechanics, placement).close()
        nodes = plate_to_breast(result.deformed, placement.angle_deg)
        return result, Deformed(self.anatomy, self.mesh, nodes)

    def mr_grid(self, spacing: float, both_breasts: bool) -> Volume:
        """The MR volume's grid, without samples yet."""
        lowest, highest = self.box
        if both_breasts:
            highest = np.array([-lowest[0], *highest[1:]])
        counts = np.ceil((highest - lowest) / spacing).astype(int)
        return Volume(np.zeros(tuple(counts), dtype=np.int16), lowest + 0.5 * spacing, np.full(3, spacing))

    def tissue_of_both_sides(self, points: Array) -> Tissue:
        """Undeformed tissue at points (N, 3); the other side mirrors this one, without its lesion."""
        mirrored = points * np.array([-1.0, 1.0, 1.0])
        other = points[:, 0] > 0.0
        tissue = self.anatomy.at(np.where(other[:, None], mirrored, points))
        return replace(tissue, lesion=np.where(other, np.float32(0.0), tissue.lesion))


def draw_placement(shape: BreastShape, view: View, random: Generator) -> Placement:
    """Roll off the header's angle, chest-wall edge, compression and pull of a view."""
    roll = float(random.uniform(*ROLL_DEG) * random.choice([-1.0, 1.0]))
    back = float(shape.back(shape.centre_m, shape.centre_s))
    edge = back - float(random.uniform(*EDGE_MM))
    share, pull = float(random.uniform(*SHARE[view])), float(random.uniform(*PULL_MM))
    return Placement(HEADER_ANGLE_DEG[view] + roll, edge, share, pull, float(random.uniform(*LIFT)))
