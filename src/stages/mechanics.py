"""Section `mechanics` of the configuration, the face of `BreastMechanics`, and what of it each stage reads."""

from typing import Literal, Self

from pydantic import Field

from mammoreg.breast.mechanics import BreastMechanics, GravityName
from mammoreg.fem.parts.back import BackName
from mammoreg.fem.plates.closing import Moving
from mammoreg.fem.skin.models import SkinName
from mammoreg.materials.tissue import MaterialName
from stages.engine.contract import SettingsModel, SharedSettings, source

_DEFAULTS = BreastMechanics()


class _TissueAndSkin(SettingsModel):
    """What a breast is made of, for stages that tell its tissues."""

    material: MaterialName = Field(
        _DEFAULTS.material,
        description="fat_and_gland: neo-Hookean, mixed in each element as segmented, their mean scaled by `calibrate`; "
        "homogeneous: one neo-Hookean tissue, the paper's choice; else fat and gland by that one of the paper's models "
        "(Table II), whose stiffness is its own",
        json_schema_extra=source(
            "chosen: the paper's is homogeneous; in vivo gland is the stiffer, with a mean strain of 0.265 against "
            "0.330 of the whole breast in nine (www.oncology.ox.ac.uk/publications/533261)"
        ),
    )
    gland_contrast: float = Field(
        _DEFAULTS.gland_contrast,
        ge=0.1,
        le=1000.0,
        description="shear modulus of gland over fat in material fat_and_gland",
        json_schema_extra=source("ratio of the initial moduli, 15.1 and 4.46 kPa, that others cite from Wellman 1999"),
    )
    skin: SkinName = Field(
        _DEFAULTS.skin,
        description="none; attached to the surface's nodes; or an enclosing membrane that is sliding on the breast or "
        "adherent where it touches (Table IV)",
        json_schema_extra=source("chosen: the paper's Table IV has 3.3 to 3.9 mm, hardly apart, with and without"),
    )
    skin_thickness_mm: float = Field(
        _DEFAULTS.skin_thickness_mm,
        gt=0.0,
        le=5.0,
        description="thickness of skin, mm",
        json_schema_extra=source("1.44 +- 0.25 mm measured (doi 10.1118/1.4793257), rounded"),
    )
    skin_modulus_kpa: float = Field(
        _DEFAULTS.skin_modulus_kpa,
        gt=0.0,
        le=1000.0,
        description="Young's modulus of skin, kPa",
        json_schema_extra=source("the paper's, below 50 % strain"),
    )


class CoarseMechanics(SharedSettings):
    """Plates, back and tissue of one kind."""

    poisson_ratio: float = Field(
        _DEFAULTS.poisson_ratio,
        ge=0.3,
        le=0.4999,
        description="Poisson's ratio of breast tissue: gives the bulk modulus, of one of the paper's models for each "
        "tissue's stiffness at the view's compression",
        json_schema_extra=source(
            "chosen: nearly incompressible; Garcia et al.'s published code searches 0.45 to 0.499"
        ),
    )
    fibre_ratio: float = Field(
        _DEFAULTS.fibre_ratio,
        ge=0.0,
        le=20.0,
        description="stiffness along the nipple axis in tension over the shear modulus (the paper's macroscopic "
        "anisotropy); "
        "0 is the paper's isotropic tissue",
        json_schema_extra=source(
            "chosen: an order of magnitude, not fitted; transverse isotropy took landmarks from 4.7 to 4.1 mm in "
            "Tanner et al., Med Phys 2011;38:682"
        ),
    )
    friction: float = Field(
        _DEFAULTS.friction,
        ge=0.0,
        description="friction between skin and plates; .inf: skin that touches sticks",
        json_schema_extra=source("0.46 +- 0.15 in vivo, Zhang and Mak, Prosthet Orthot Int 1999"),
    )
    moving: Moving = Field(
        _DEFAULTS.moving,
        description="plates that move; with one of them the back, which stays, bears the difference of the plates' "
        "forces. Where a second volume shows the plates they end there whichever move",
        json_schema_extra=source("chosen: which plate has moved, and how far, is not recorded"),
    )
    lip_radius_mm: float = Field(
        _DEFAULTS.lip_radius_mm,
        ge=1.0,
        le=30.0,
        description="radius of the plates' chest-wall lips, mm",
        json_schema_extra=source("chosen: the order of a paddle's rounded edge; no source"),
    )
    plates_end: bool = Field(
        _DEFAULTS.plates_end,
        description="plates end at the image's chest-wall edge; false: they go on to the chest wall",
        json_schema_extra=source("chosen: the image ends where the plates do"),
    )
    back: BackName = Field(
        _DEFAULTS.back,
        description="chest-wall side of the breast: fixed; shear_layer, held towards the chest wall and sliding along "
        "it against the shear of the tissue behind; slide_compression, so along the plates' direction only; "
        "slide_plane, free in its own surface; springs, in its surface against that shear",
        json_schema_extra=source(
            "chosen: the back may slide along the chest wall, not leave it, as in Garcia et al.'s published code"
        ),
    )
    back_layer: Literal["measured", "constant"] = Field(
        "constant",
        description="the layer behind the model's back: always back_layer_mm, or measured in the MR volume where the "
        "pectoral muscle shows",
        json_schema_extra=source("chosen: what the measured one changes was tried on few breasts only"),
    )
    back_layer_mm: float = Field(
        _DEFAULTS.back_layer_mm,
        gt=0.0,
        le=1000.0,
        description="soft tissue between the model's back and the chest wall, which shears as the back slides, where "
        "it is not measured, mm",
        json_schema_extra=source("chosen: some centimetres of soft tissue; no source"),
    )
    gravity: GravityName = Field(
        _DEFAULTS.gravity,
        description="standing: while the plates close, the weight changes from that of a prone patient, which the MR "
        "volume shows, to that of one who stands",
        json_schema_extra=source("as in the paper, which leaves gravity out"),
    )
    density_kg_m3: float = Field(
        _DEFAULTS.density_kg_m3,
        gt=0.0,
        le=2000.0,
        description="density of tissue for its weight, kg/m3",
        json_schema_extra=source("chosen: water; fat has 920, gland 1035 (VICTRE)"),
    )

    def numerics(self) -> BreastMechanics:
        """The same for `mammoreg`; a breast whose tissues are not told is homogeneous and has no skin of its own."""
        alike = {"material": "homogeneous", "gland_contrast": 1.0, "skin": "none"}
        told = {name: value for name, value in dict(self).items() if name != "back_layer"}
        return BreastMechanics(**{**alike, **told})

    def of_patient(self, layer_mm: float | None) -> Self:
        """The same with the layer behind the back as it was measured; None: it does not show."""
        measured = self.back_layer == "measured" and layer_mm is not None
        return self.model_copy(update={"back_layer_mm": layer_mm}) if measured else self


class Mechanics(CoarseMechanics, _TissueAndSkin):
    """Tissue, skin, plates and the condition at the breast's back."""
