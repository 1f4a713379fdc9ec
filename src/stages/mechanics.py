"""Mechanics that the stages pose, compress and solve share: settings, model and back of a breast in the plate frame."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mammoreg.fem.boundary import BackCondition, back_condition
from mammoreg.fem.model import HyperelasticModel
from mammoreg.geometry import breast_to_plate
from mammoreg.materials.elastic import neo_hookean
from mammoreg.meshing.block import BlockMesh
from stages.contract import SettingsModel

Floats = NDArray[np.float64]


class Mechanics(SettingsModel):
    """Tissue, plates and the condition at the breast's back."""

    poisson_ratio: float = Field(0.495, ge=0.3, le=0.4999, description="Poisson's ratio of breast tissue")
    gland_contrast: float = Field(
        1.0, ge=0.1, le=1000.0, description="shear modulus of gland over fat; 1 is the paper's homogeneous tissue"
    )
    fibre_ratio: float = Field(
        1.0,
        ge=0.0,
        le=20.0,
        description="stiffness along the nipple axis in tension over the shear modulus (the paper's macroscopic "
        "anisotropy); "
        "1 is an order of magnitude, not a fit, and 0 the paper's isotropic tissue",
    )
    friction: float = Field(
        0.46,
        ge=0.0,
        le=2.0,
        description="friction between skin and plates; 0.46 +- 0.15 in vivo (Zhang and Mak, Prosthet Orthot Int 1999)",
    )
    lip_radius_mm: float = Field(8.0, ge=1.0, le=30.0, description="radius of the plates' chest-wall lips, mm")
    plates_end: bool = Field(
        True, description="plates end at the image's chest-wall edge; false: they go on to the chest wall"
    )
    back: Literal["fixed", "slide_compression", "slide_plane", "springs"] = Field(
        "slide_compression",
        description="chest-wall side of the breast: fixed; slide_compression, against the shear of "
        "the tissue behind it along the plates' direction only; "
        "slide_plane, free in its own surface; springs, in its surface against that shear",
    )
    back_layer_mm: float = Field(
        35.0,
        gt=0.0,
        le=1000.0,
        description="soft tissue between the model's back and the chest wall, which shears as the back slides, mm",
    )

    @property
    def tells_gland_from_fat(self) -> bool:
        """Whether the material needs the tissue map."""
        return self.gland_contrast != 1.0


@dataclass(frozen=True)
class PlacedBreast:
    """A breast in the plate frame, ready to be compressed.

    Attributes:
        model: elements and material.
        back: condition of its back.
        skin_quads: faces of its skin.
    """

    model: HyperelasticModel
    back: BackCondition
    skin_quads: NDArray[np.int64]


def place_breast(
    mesh: BlockMesh, angle_deg: float, mechanics: Mechanics, mu_kpa: float, gland: Floats | None = None
) -> PlacedBreast:
    """Turn a breast to a projection angle and give it tissue.

    Args:
        mesh: undeformed, breast frame.
        angle_deg: projection angle.
        mechanics: settings.
        mu_kpa: shear modulus of the homogeneous tissue, the volume's mean where gland differs from fat.
        gland: share of gland per element (E,), where the material tells gland from fat.

    Raises:
        ValueError: the material tells gland from fat and their shares are not given.
    """
    points = breast_to_plate(mesh.points, angle_deg)
    mu: float | Floats = mu_kpa
    if mechanics.tells_gland_from_fat:
        if gland is None:
            raise ValueError("a material that tells gland from fat needs the share of gland in each element")
        relative = 1.0 + (mechanics.gland_contrast - 1.0) * gland
        mu = mu_kpa * relative / float(relative.mean())
    fibre = fibre_kpa = None
    if mechanics.fibre_ratio > 0.0:
        fibre, fibre_kpa = _nipple_axis(mesh, angle_deg), mechanics.fibre_ratio * mu_kpa
    material = neo_hookean(mu, mechanics.poisson_ratio, fibre, fibre_kpa)
    model = HyperelasticModel(points, mesh.hexes(), material)
    shear = mu_kpa / mechanics.back_layer_mm
    back = back_condition(mechanics.back, points, mesh.back_quads(), shear, along_kpa_per_mm=shear)
    return PlacedBreast(model, back, mesh.skin_quads())


def _nipple_axis(mesh: BlockMesh, angle_deg: float) -> Floats:
    """Direction (3,) from the back's middle to the cap's, plate frame."""
    grid = mesh.node_grid()
    axis = mesh.points[grid[:, :, -1]].mean(axis=(0, 1)) - mesh.points[grid[:, :, 0]].mean(axis=(0, 1))
    return breast_to_plate(axis / np.linalg.norm(axis), angle_deg)
