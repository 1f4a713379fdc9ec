"""Material and chest wall of a digital patient: mechanics that the registration does not use.

Gland and lesion are stiffer than fat, the plates rub, and the chest wall yields: the back rests on springs, softer
across than along the wall's normal, whose anchors the radiographer has pulled forward.
"""

from dataclasses import dataclass

import numpy as np

from mammoreg.geometry import breast_to_plate
from mammoreg.materials.elastic import ElasticMaterial, neo_hookean
from mammoreg.meshing.trilinear import shape_functions, volumes
from mammoreg.phantom.anatomy import Anatomy
from mammoreg.phantom.mesh import PhantomMesh
from mammoreg.phantom.shape import Array

SAMPLES = np.stack(np.meshgrid(*[np.array([-0.75, -0.25, 0.25, 0.75])] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class Mechanics:
    """Physics of one patient.

    Attributes:
        fat_kpa: shear modulus of fat.
        gland_ratio, lesion_ratio, skin_ratio: how many times stiffer gland, lesion and skin are.
        poisson: Poisson's ratio.
        friction: Coulomb coefficient at the plates.
        wall_normal_kpa_per_mm, wall_tangential_kpa_per_mm: stiffness of the chest wall per area.
        lip_radius_mm: rounding of the plates' chest-wall edge.
        fibre_ratio: stiffness in tension of fibres along the nipple axis over the shear modulus of fat.
        fibre_stiffening: exponent with which they stiffen.
    """

    fat_kpa: float
    gland_ratio: float
    lesion_ratio: float
    skin_ratio: float
    poisson: float
    friction: float
    wall_normal_kpa_per_mm: float
    wall_tangential_kpa_per_mm: float
    lip_radius_mm: float
    fibre_ratio: float
    fibre_stiffening: float


@dataclass(frozen=True)
class Placement:
    """How the breast stands between the plates.

    Attributes:
        angle_deg: true projection angle.
        edge_p_mm: posterior coordinate of the plates' and the image's chest-wall edge.
        share: share of the uncompressed thickness that the plates take away.
        pull_mm: how far the radiographer pulls the breast forward.
        lift: how far the plates' middle is moved towards the nipple's height, as a share.
    """

    angle_deg: float
    edge_p_mm: float
    share: float
    pull_mm: float
    lift: float


def breast_material(anatomy: Anatomy, mesh: PhantomMesh, mechanics: Mechanics, angle_deg: float) -> ElasticMaterial:
    """Material of the elements in the plate frame of an angle; fibres follow the bent nipple axis."""
    centres = mesh.points[mesh.hexes].mean(axis=1)
    along = breast_to_plate(anatomy.shape.axis_direction(centres[:, 1]), angle_deg)
    moduli = element_moduli(anatomy, mesh, mechanics)
    stiffness = mechanics.fibre_ratio * mechanics.fat_kpa
    return neo_hookean(moduli, mechanics.poisson, along, stiffness, mechanics.fibre_stiffening)


def element_moduli(anatomy: Anatomy, mesh: PhantomMesh, mechanics: Mechanics) -> Array:
    """Shear modulus (E,) in kPa: the mean over each element of fat, gland and lesion, and of skin by its volume."""
    places = np.einsum("qa,eac->eqc", shape_functions(SAMPLES), mesh.points[mesh.hexes])
    tissue = anatomy.at(places.reshape(-1, 3))
    ratio = 1.0 + (mechanics.gland_ratio - 1.0) * tissue.gland
    ratio += tissue.lesion * (mechanics.lesion_ratio - ratio)
    inner = ratio.reshape(len(mesh.hexes), -1).mean(axis=1)
    skin = np.minimum(anatomy.layers.skin * _skin_area(mesh) / volumes(mesh.points[mesh.hexes]), 1.0)
    return np.asarray(mechanics.fat_kpa * (inner + skin * (mechanics.skin_ratio - inner)), dtype=float)


def _skin_area(mesh: PhantomMesh) -> Array:
    """Area (E,) in mm2 of the skin on each element."""
    owner = {tuple(sorted(face)): e for e, face in enumerate(mesh.hexes[:, 4:].tolist())}
    corners = mesh.points[mesh.skin_quads]
    face = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)
    area = np.zeros(len(mesh.hexes))
    area[[owner[tuple(sorted(quad))] for quad in mesh.skin_quads.tolist()]] = face
    return area


def wall_springs(points: Array, mesh: PhantomMesh, mechanics: Mechanics) -> Array:
    """Springs (B, 3, 3), mN/mm, of the nodes on the back: one stiffness along their normals, a lower one across.

    Args:
        points: undeformed nodes (N, 3) in the plate frame, mm.
        mesh: whose faces at the back count.
        mechanics: gives the stiffnesses per area.
    """
    corners = points[mesh.back_quads]
    face = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = np.zeros((len(points), 3))
    np.add.at(area, mesh.back_quads.ravel(), np.repeat(0.25 * face, 4, axis=0))
    size = np.linalg.norm(area[mesh.back], axis=1)
    normal = area[mesh.back] / size[:, None]
    along = normal[:, :, None] * normal[:, None, :]
    per_area = mechanics.wall_normal_kpa_per_mm * along
    per_area = per_area + mechanics.wall_tangential_kpa_per_mm * (np.eye(3) - along)
    return np.asarray(size[:, None, None] * per_area)
