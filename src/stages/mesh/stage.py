"""Stage `mesh`: the breast as a block of hexahedra, with its quality."""

import numpy as np
from pydantic import Field

from mammoreg.meshing.breast import BreastMesh, build_mesh
from mammoreg.meshing.quality import MeshQuality
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value, source
from stages.mesh.record import mesh_fields
from stages.segment.record import SegmentRecord


class Settings(SettingsModel):
    """Settings of the mesh."""

    elements: int = Field(7, ge=3, le=42, description="hexahedra a side", json_schema_extra=source("the paper's"))
    max_volume_error: float = Field(0.02, gt=0.0, description="warn above this share of the mask's volume")
    max_distance_mean_mm: float = Field(1.0, gt=0.0, description="warn above this mean distance of the surfaces, mm")
    max_distance_p95_mm: float = Field(3.0, gt=0.0, description="warn above this 95 % distance of the surfaces, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Mesh the segmented breast."""
    segment = SegmentRecord(inputs.artefact("segment"))
    built = build_mesh(segment.breast_mask, segment.chest_wall, segment.nipple, settings.elements)
    return mesh_fields(built.mesh, subject.laterality, _values(built, settings))


def _values(built: BreastMesh, settings: Settings) -> dict[str, Value]:
    quality = built.quality
    return {
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
