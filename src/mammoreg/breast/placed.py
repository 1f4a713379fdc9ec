"""The breast in the plate frame with its tissue, skin, back and weight, and plates around it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats
from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, back_condition
from mammoreg.fem.parts.gravity import Gravity, gravity
from mammoreg.fem.parts.part import Part
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.fem.skin.law import TensionLinear
from mammoreg.fem.skin.models import SkinModel, skin_model
from mammoreg.geometry import breast_to_plate
from mammoreg.materials.tissue import BreastTissue, catalogue_tissue, neo_hookean_tissue
from mammoreg.meshing.block import BlockMesh

_INFERIOR, _ANTERIOR = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class PlacedBreast:
    """A breast in the plate frame, ready to be compressed.

    Attributes:
        model: elements and material.
        back: condition of its back.
        back_quads: faces (F, 4) there.
        skin: what its skin adds, and the faces that meet the plates.
        loads: its weight, where it counts.
        stiffness_ratio: shear modulus at the compression to come over the initial one.
    """

    model: HyperelasticModel
    back: BackCondition
    back_quads: NDArray[np.int64]
    skin: SkinModel
    loads: tuple[Part, ...] = ()
    stiffness_ratio: float = 1.0

    @property
    def contact_quads(self) -> NDArray[np.int64]:
        """Faces (F, 4) that the plates may press: the skin's and the back's."""
        # Where the back bends forward, above and below, the tissue behind it lies between the plates too.
        return np.concatenate([self.skin.contact_quads, self.back_quads])


def place_breast(
    mesh: BlockMesh,
    angle_deg: float,
    mechanics: BreastMechanics,
    mu_kpa: float,
    gland: Floats | None = None,
    compression: float = 0.0,
) -> PlacedBreast:
    """Turn a breast to a projection angle and give it tissue.

    Args:
        mesh: undeformed, breast frame.
        angle_deg: projection angle.
        mechanics: tissue, skin, back and weight.
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
    return PlacedBreast(model, back, mesh.back_quads(), skin, loads, tissue.stiffness_ratio)


def closing_plates(
    breast: PlacedBreast,
    edge_p_mm: float,
    mechanics: BreastMechanics,
    options: ClosingOptions,
    lower_mm: float | None = None,
) -> Closing:
    """Plates around a placed breast; `lower_mm` is the lower plate's height where a second volume shows it."""
    return Closing(
        breast.model,
        breast.contact_quads,
        breast.back,
        edge_p_mm if mechanics.plates_end else None,
        mechanics.lip_radius_mm,
        mechanics.friction if breast.skin.shear_passes else 0.0,
        options,
        lower_mm,
        (*breast.loads, *breast.skin.parts),
        breast.skin.extra_nodes,
        mechanics.moving if lower_mm is None else "both",
    )


def _standing_up(model: HyperelasticModel, density_kg_m3: float, angle_deg: float) -> Gravity:
    """Weight of a standing patient less that of a prone one: two loads of equal size, as one."""
    change = breast_to_plate(_INFERIOR - _ANTERIOR, angle_deg)
    return gravity(model, density_kg_m3 * float(np.linalg.norm(change)), change)


def _tissue(mechanics: BreastMechanics, mu_kpa: float, gland: Floats | None, compression: float) -> BreastTissue:
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
