"""Stage `mesh`: the breast as a block of hexahedra, with its quality."""

import numpy as np
from pydantic import Field

from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.meshing.breast import BreastMesh, build_mesh
from mammoreg.meshing.quality import MeshQuality
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value

# In a left breast LPS mirrors the block: swapping the ends of its first axis makes the elements right-handed again.
_MIRRORED_ORDER = [1, 0, 3, 2, 5, 4, 7, 6]


class Settings(SettingsModel):
    """Settings of the mesh."""

    elements: int = Field(7, ge=3, le=42, description="hexahedra a side (paper: 7)")
    max_volume_error: float = Field(0.02, gt=0.0, description="warn above this share of the mask's volume")
    max_distance_mean_mm: float = Field(1.0, gt=0.0, description="warn above this mean distance of the surfaces, mm")
    max_distance_p95_mm: float = Field(3.0, gt=0.0, description="warn above this 95 % distance of the surfaces, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Mesh the segmented breast."""
    side = subject.laterality
    segment = inputs.artefact("segment")
    mask = segment.volume("breast_mask").to_breast(side)
    back, nipple = (lps_to_breast(segment.array(name, "mm"), side) for name in ("chest_wall_surface", "nipple"))
    built = build_mesh(mask, back, nipple, settings.elements)
    hexes = built.mesh.hexes()
    arrays = {
        "points": Array(breast_to_lps(built.mesh.points, side), "mm", "nodes of the block, first axis to medial"),
        "hexes": Array(hexes[:, _MIRRORED_ORDER] if side == "L" else hexes, "1", "nodes of each hexahedron, VTK order"),
    }
    return Fields(arrays=arrays, values=_values(built, settings))


def _values(built: BreastMesh, settings: Settings) -> dict[str, Value]:
    quality = built.quality
    return {
        "n": built.mesh.n,
        "min_gauss_jacobian": quality.min_gauss_jacobian,
        "min_corner_jacobian": quality.min_corner_jacobian,
        "volume_error": quality.volume_error,
        "surface_distance_mean_mm": quality.surface_distance_mean_mm,
        "surface_distance_p95_mm": quality.surface_distance_p95_mm,
        "warnings": list(_warnings(quality, settings)),
    }


def _warnings(quality: MeshQuality, settings: Settings) -> list[str]:
    """What the mesh misses of the required quality, in words."""
    checks = (
        (abs(quality.volume_error), settings.max_volume_error, "volume differs from the mask's by a share of"),
        (quality.surface_distance_mean_mm, settings.max_distance_mean_mm, "mean surface distance in mm is"),
        (quality.surface_distance_p95_mm, settings.max_distance_p95_mm, "95 % surface distance in mm is"),
    )
    return [f"{what} {found:.3g}, above {limit:g}" for found, limit, what in checks if not np.less_equal(found, limit)]


STAGE = Stage(name="mesh", schema=2, inputs=("segment",), settings=Settings, run=run)
