"""Mechanics that the stages pose, compress and solve share: settings, model and back of a breast in the plate frame."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, BackName, back_condition
from mammoreg.fem.parts.gravity import Gravity, gravity
from mammoreg.fem.parts.part import Part
from mammoreg.fem.plates.closing import Moving
from mammoreg.fem.skin.law import SKIN_MODULUS_KPA, TensionLinear
from mammoreg.fem.skin.membrane import SKIN_THICKNESS_MM
from mammoreg.fem.skin.models import SkinModel, SkinName, skin_model
from mammoreg.geometry import breast_to_plate
from mammoreg.materials.tissue import MaterialName, Tissue, catalogue_tissue, neo_hookean_tissue
from mammoreg.meshing.block import BlockMesh
from stages.engine.contract import SettingsModel

Floats = NDArray[np.float64]
_INFERIOR, _ANTERIOR = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])


class Mechanics(SettingsModel):
    """Tissue, plates and the condition at the breast's back."""

    material: MaterialName = Field(
        "fat_and_gland",
        description="fat_and_gland: neo-Hookean, mixed in each element as segmented, their mean scaled by `calibrate`; "
        "homogeneous: one neo-Hookean tissue, the paper's choice; else fat and gland by that one of the paper's models "
        "(Table II), whose stiffness is its own",
    )
    poisson_ratio: float = Field(
        0.495,
        ge=0.3,
        le=0.4999,
        description="Poisson's ratio of breast tissue: gives the bulk modulus, of one of the paper's models for each "
        "tissue's stiffness at the view's compression",
    )
    gland_contrast: float = Field(
        3.4,
        ge=0.1,
        le=1000.0,
        description="shear modulus of gland over fat in material fat_and_gland; 3.4 is the ratio of Wellman's initial "
        "moduli, 15.1 and 4.46 kPa",
    )
    fibre_ratio: float = Field(
        1.0,
        ge=0.0,
        le=20.0,
        description="stiffness along the nipple axis in tension over the shear modulus (the paper's macroscopic "
        "anisotropy); "
        "1 is an order of magnitude, not a fit, and 0 the paper's isotropic tissue",
    )
    skin: SkinName = Field(
        "none",
        description="none; attached to the surface's nodes; or an enclosing membrane that is sliding on the breast or "
        "adherent where it touches (Table IV)",
    )
    skin_thickness_mm: float = Field(SKIN_THICKNESS_MM, gt=0.0, le=5.0, description="thickness of skin, mm")
    skin_modulus_kpa: float = Field(
        SKIN_MODULUS_KPA, gt=0.0, le=1000.0, description="Young's modulus of skin, kPa (paper: 10 below 50 % strain)"
    )
    friction: float = Field(
        0.46,
        ge=0.0,
        description="friction between skin and plates; 0.46 +- 0.15 in vivo (Zhang and Mak, Prosthet Orthot Int 1999); "
        ".inf: skin that touches sticks",
    )
    moving: Moving = Field(
        "both",
        description="plates that move; with one of them the back, which stays, bears the difference of the plates' "
        "forces. Where a second volume shows the plates they end there whichever move",
    )
    lip_radius_mm: float = Field(8.0, ge=1.0, le=30.0, description="radius of the plates' chest-wall lips, mm")
    plates_end: bool = Field(
        True, description="plates end at the image's chest-wall edge; false: they go on to the chest wall"
    )
    back: BackName = Field(
        "shear_layer",
        description="chest-wall side of the breast: fixed; shear_layer, held towards the chest wall and sliding along "
        "it against the shear of the tissue behind; slide_compression, so along the plates' direction only; "
        "slide_plane, free in its own surface; springs, in its surface against that shear",
    )
    back_layer_mm: float = Field(
        35.0,
        gt=0.0,
        le=1000.0,
        description="soft tissue between the model's back and the chest wall, which shears as the back slides, mm",
    )

    gravity: Literal["none", "standing"] = Field(
        "none",
        description="standing: while the plates close, the weight changes from that of a prone patient, which the MR "
        "volume shows, to that of one who stands",
    )
    density_kg_m3: float = Field(1000.0, gt=0.0, le=2000.0, description="density of tissue for its weight, kg/m3")

    @property
    def tells_gland_from_fat(self) -> bool:
        """Whether the material needs the tissue map."""
        return self.material != "homogeneous"


@dataclass(frozen=True)
class PlacedBreast:
    """A breast in the plate frame, ready to be compressed.

    Attributes:
        model: elements and material.
        back: condition of its back.
        back_quads: faces (F, 4) there.
        skin: what its skin adds, and the faces that meet the plates.
        loads: its weight, where it counts.
        stiffening: shear modulus at the compression to come over the initial one.
    """

    model: HyperelasticModel
    back: BackCondition
    back_quads: NDArray[np.int64]
    skin: SkinModel
    loads: tuple[Part, ...] = ()
    stiffening: float = 1.0

    @property
    def contact_quads(self) -> NDArray[np.int64]:
        """Faces (F, 4) that the plates may press: the skin's and the back's."""
        # Where the back bends forward, above and below, the tissue behind it lies between the plates too.
        return np.concatenate([self.skin.contact_quads, self.back_quads])


def place_breast(
    mesh: BlockMesh,
    angle_deg: float,
    mechanics: Mechanics,
    mu_kpa: float,
    gland: Floats | None = None,
    compression: float = 0.0,
) -> PlacedBreast:
    """Turn a breast to a projection angle and give it tissue.

    Args:
        mesh: undeformed, breast frame.
        angle_deg: projection angle.
        mechanics: settings.
        mu_kpa: shear modulus of the homogeneous tissue, the volume's mean where gland differs from fat.
        gland: share of gland per element (E,), where the material tells gland from fat.
        compression: share of its thickness that the plates will take, for a material of the catalogue.

    Raises:
        ValueError: the material tells gland from fat and their shares are not given.
    """
    points = breast_to_plate(mesh.points, angle_deg)
    tissue = _tissue(mechanics, mu_kpa, gland, compression)
    if mechanics.fibre_ratio > 0.0:
        tissue = tissue.with_fibres(_nipple_axis(mesh, angle_deg), mechanics.fibre_ratio)
    model = HyperelasticModel(points, mesh.hexes(), tissue.material)
    shear = tissue.mu_kpa / mechanics.back_layer_mm
    back = back_condition(mechanics.back, points, mesh.back_quads(), shear, along_kpa_per_mm=shear)
    law = TensionLinear(mechanics.skin_modulus_kpa)
    skin = skin_model(mechanics.skin, model, mesh.skin_quads(), law, mechanics.skin_thickness_mm)
    loads = (_standing_up(model, mechanics.density_kg_m3, angle_deg),) if mechanics.gravity == "standing" else ()
    return PlacedBreast(model, back, mesh.back_quads(), skin, loads, tissue.stiffening)


def _standing_up(model: HyperelasticModel, density_kg_m3: float, angle_deg: float) -> Gravity:
    """Weight of a standing patient less that of a prone one: two loads of equal size, as one."""
    change = breast_to_plate(_INFERIOR - _ANTERIOR, angle_deg)
    return gravity(model, density_kg_m3 * float(np.linalg.norm(change)), change)


def _tissue(mechanics: Mechanics, mu_kpa: float, gland: Floats | None, compression: float) -> Tissue:
    if mechanics.material == "homogeneous":
        return neo_hookean_tissue(mu_kpa, mechanics.poisson_ratio)
    if mechanics.material == "fat_and_gland":
        return neo_hookean_tissue(mu_kpa, mechanics.poisson_ratio, mechanics.gland_contrast, gland)
    return catalogue_tissue(mechanics.material, mechanics.poisson_ratio, gland, compression)


def _nipple_axis(mesh: BlockMesh, angle_deg: float) -> Floats:
    """Direction (3,) from the back's middle to the cap's, plate frame."""
    grid = mesh.node_grid()
    axis = mesh.points[grid[:, :, -1]].mean(axis=(0, 1)) - mesh.points[grid[:, :, 0]].mean(axis=(0, 1))
    return breast_to_plate(axis / np.linalg.norm(axis), angle_deg)
