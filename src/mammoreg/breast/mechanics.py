"""Which mechanics a breast gets: tissue, skin, plates, back and weight."""

from dataclasses import dataclass
from typing import Literal

from mammoreg.fem.parts.back import BackName
from mammoreg.fem.plates.closing import Moving
from mammoreg.fem.skin.law import SKIN_MODULUS_KPA
from mammoreg.fem.skin.membrane import SKIN_THICKNESS_MM
from mammoreg.fem.skin.models import SkinName
from mammoreg.materials.tissue import MaterialName

GravityName = Literal["none", "standing"]


@dataclass(frozen=True)
class BreastMechanics:
    """Parameters of a breast's mechanics; the keys of the configuration explain each at length.

    Attributes:
        material: fat_and_gland, homogeneous, or one of the paper's models (Table II).
        poisson_ratio: of the tissue.
        gland_contrast: shear modulus of gland over fat in fat_and_gland (Wellman's initial moduli, 15.1 and 4.46 kPa).
        fibre_ratio: stiffness along the nipple axis in tension over the shear modulus; 0 is isotropic.
        skin: none, attached, sliding or adherent.
        skin_thickness_mm, skin_modulus_kpa: of skin.
        friction: Coulomb coefficient between skin and plates (Zhang and Mak, Prosthet Orthot Int 1999).
        moving: plates that move.
        lip_radius_mm: of the plates' chest-wall lips.
        plates_end: whether plates end at the image's chest-wall edge, or go on to the chest wall.
        back: condition at the breast's chest-wall side.
        back_layer_mm: soft tissue between the model's back and the chest wall.
        gravity: standing, the change of weight from a prone patient to one who stands; or none.
        density_kg_m3: of tissue.
    """

    material: MaterialName = "fat_and_gland"
    poisson_ratio: float = 0.495
    gland_contrast: float = 3.4
    fibre_ratio: float = 1.0
    skin: SkinName = "none"
    skin_thickness_mm: float = SKIN_THICKNESS_MM
    skin_modulus_kpa: float = SKIN_MODULUS_KPA
    friction: float = 0.46
    moving: Moving = "both"
    lip_radius_mm: float = 8.0
    plates_end: bool = True
    back: BackName = "shear_layer"
    back_layer_mm: float = 35.0
    gravity: GravityName = "none"
    density_kg_m3: float = 1000.0

    @property
    def tells_gland_from_fat(self) -> bool:
        """Whether the material needs the tissue map."""
        return self.material != "homogeneous"
