"""Stage `pose`: where the breast lay between the plates: projection angle, imaged portion and plates (section III)."""

import numpy as np
from pydantic import Field

from mammoreg.errors import NotConvergedError
from mammoreg.geometry import ViewGeometry, lps_to_breast
from mammoreg.geometry.frames import Points
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.estimate import PoseEstimate, estimate_pose
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.mechanics import Mechanics
from stages.methods import block_mesh
from stages.pose.affine import affine_arrays, rigid_values
from stages.pose.coarse import coarse_compression
from stages.pose.dense_tissue import coarse_tissue
from stages.pose.start import start_view, without_image
from stages.pose.view_facts import Seen, see_mammogram, see_second_volume

ANGLE_AT_BOUND = "angle at its bound"
ANGLE_FROM_HEADER = "angle not determined by the image"
NOT_DRAWN = "breast not drawn to the second volume's outline, for the coarse compression did not converge"


class Settings(SettingsModel):
    """Search for the pose with a coarse compression."""

    mechanics: Mechanics = Field(
        Mechanics(), description="plates and back of the coarse compression; its tissue is homogeneous"
    )
    angle_step_deg: float = Field(
        4.0, ge=0.0, le=20.0, description="distance of the angles tried, degrees; 0 keeps the header's angle"
    )
    angle_bound_deg: float = Field(16.0, gt=0.0, le=45.0, description="largest offset from the header's angle, degrees")
    angle_sd_deg: float = Field(5.0, gt=0.0, le=30.0, description="standard deviation of the header's angle, degrees")
    use_density: bool = Field(True, description="let dense tissue judge the angle beside the outline")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Estimate the pose of one view."""
    segment, mesh = inputs.artefact("segment"), block_mesh(inputs.artefact("mesh"))
    image = inputs.path("image")
    if image is not None:
        seen = see_mammogram(image, subject, "MLO" if subject.view == "MLO" else "CC")
    elif segment.has("compressed_mask"):
        seen = see_second_volume(segment.volume("compressed_mask").to_breast(subject.laterality))
    else:
        return without_image(mesh, subject)
    nipple = lps_to_breast(segment.array("nipple", "mm"), subject.laterality)
    mu_kpa = float(inputs.artefact("calibrate").value("mu_kpa"))
    compress = coarse_compression(mesh, settings.mechanics.numerics(), mu_kpa, plates_known=seen.placed)
    start, estimated, doubts = start_view(seen, mesh, compress)
    tissue = coarse_tissue(segment, mesh) if settings.use_density and not seen.placed else None
    found = estimate_pose(
        start,
        seen.outline,
        compress,
        skin_facets(mesh.skin_quads(), len(mesh.points), 2),
        0.0 if seen.placed else settings.angle_step_deg,
        settings.angle_bound_deg,
        settings.angle_sd_deg,
        tissue,
        seen.density,
    )
    if found is None and seen.placed:
        known: dict[str, Value] = {"angle_determined": True, "angle_sd_deg": None, "drawn_mm": [0.0, 0.0, 0.0]}
        return _fields(seen, mesh, nipple, start, start, known, estimated, (NOT_DRAWN,))
    if found is None:
        raise NotConvergedError("the coarse compression converged at none of the angles tried, so the pose is unknown")
    flags = () if seen.placed else (*doubts, *_angle_flags(found))
    return _fields(seen, mesh, nipple, start, found.view, _search_values(found, seen), estimated, flags)


def _angle_flags(found: PoseEstimate) -> tuple[str, ...]:
    doubts = ((ANGLE_AT_BOUND, found.at_bound), (ANGLE_FROM_HEADER, not found.determined))
    return tuple(text for text, holds in doubts if holds)


def _search_values(found: PoseEstimate, seen: Seen) -> dict[str, Value]:
    drawn = [seen.geometry.middle_mm - found.view.middle_mm, seen.geometry.edge_p_mm - found.view.edge_p_mm, 0.0]
    return {
        "angle_determined": found.determined or seen.placed,
        # How far the breast was drawn over the plates: from the model's to the second volume's place, plate axes.
        "drawn_mm": drawn if seen.placed else None,
        "angle_sd_deg": found.angle_sd_deg if np.isfinite(found.angle_sd_deg) else None,
        "coarse_rms_mm": found.alignment.rms_mm,
        "tried": [
            {
                "angle_deg": c.angle_deg,
                "outline_rms_mm": c.alignment.rms_mm,
                "skin_rms_mm": c.skin.rms_mm if np.isfinite(c.skin.rms_mm) else None,
                "rim_share": c.rim_share,
                "density_ncc": c.ncc,
                "misfit": c.misfit,
                "edge_p_mm": c.alignment.view.edge_p_mm,
            }
            for c in found.candidates
        ],
    }


def _fields(
    seen: Seen,
    mesh: BlockMesh,
    nipple: Points,
    start: ViewGeometry,
    view: ViewGeometry,
    search: dict[str, Value],
    estimated: tuple[str, ...],
    flags: tuple[str, ...],
) -> Fields:
    arrays: dict[str, Array] = {**seen.arrays, **affine_arrays(mesh, start, view, seen)}
    values: dict[str, Value] = {
        **seen.values,
        "plates_known": seen.placed,
        "angle_deg": view.angle_deg,
        "header_angle_deg": seen.geometry.angle_deg,
        "edge_p_mm": view.edge_p_mm,
        "middle_mm": view.middle_mm,
        "height_mm": view.height_mm,
        "thickness_mm": view.thickness_mm,
        "source_detector_mm": view.source_detector_mm,
        "support_detector_mm": view.support_detector_mm,
        "pixel_mm": view.pixel_mm,
        "rows": view.rows,
        "columns": view.columns,
        **rigid_values(mesh, start, seen, nipple),
        **search,
        "estimated": list(estimated),
        "flags": [*seen.flags, *flags],
    }
    return Fields(arrays=arrays, values=values)


STAGE = Stage(
    name="pose", schema=1, inputs=("segment", "mesh", "calibrate"), optional=("image",), settings=Settings, run=run
)
