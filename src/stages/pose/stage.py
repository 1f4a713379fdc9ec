"""Stage `pose`: where the breast lay between the plates: projection angle, imaged portion and plates (section III)."""

import numpy as np
from pydantic import Field

from mammoreg.errors import NotConvergedError
from mammoreg.geometry import ViewGeometry
from mammoreg.geometry.frames import Points
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.estimate import PoseEstimate, estimate_pose
from stages.calibrate.record import CalibrateRecord
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.mechanics import Mechanics
from stages.mesh.record import MeshRecord
from stages.pose.affine import affine_maps, rigid_geometry
from stages.pose.coarse import coarse_compression
from stages.pose.dense_tissue import coarse_tissue
from stages.pose.record import PoseFields
from stages.pose.start import start_view, without_image
from stages.pose.view_facts import ViewFacts, facts_of_mammogram, facts_of_second_volume
from stages.segment.record import SegmentRecord

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
    angle_sd_deg: float = Field(
        5.0, gt=0.0, le=30.0, description="standard deviation of the header's angle, chosen, degrees"
    )
    use_density: bool = Field(True, description="let dense tissue judge the angle beside the outline")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Estimate the pose of one view."""
    segment, mesh = SegmentRecord(inputs.artefact("segment")), MeshRecord(inputs.artefact("mesh")).block
    image, second = inputs.path("image"), segment.compressed_mask
    if image is not None:
        facts = facts_of_mammogram(image, subject, "MLO" if subject.view == "MLO" else "CC")
    elif second is not None:
        facts = facts_of_second_volume(second)
    else:
        return without_image(mesh, subject)
    mu_kpa = CalibrateRecord(inputs.artefact("calibrate")).mu_kpa
    compress = coarse_compression(mesh, settings.mechanics.numerics(), mu_kpa, plates_known=facts.placed)
    start, estimated, doubts = start_view(facts, mesh, compress)
    tissue = coarse_tissue(segment, mesh) if settings.use_density and not facts.placed else None
    found = estimate_pose(
        start,
        facts.outline,
        compress,
        skin_facets(mesh.skin_quads(), len(mesh.points), 2),
        0.0 if facts.placed else settings.angle_step_deg,
        settings.angle_bound_deg,
        settings.angle_sd_deg,
        tissue,
        facts.density,
    )
    if found is None and facts.placed:
        return _fields(facts, mesh, segment.nipple, start, None, estimated, (NOT_DRAWN,))
    if found is None:
        raise NotConvergedError("the coarse compression converged at none of the angles tried, so the pose is unknown")
    flags = () if facts.placed else (*doubts, *_angle_flags(found))
    return _fields(facts, mesh, segment.nipple, start, found, estimated, flags)


def _angle_flags(found: PoseEstimate) -> tuple[str, ...]:
    doubts = ((ANGLE_AT_BOUND, found.at_bound), (ANGLE_FROM_HEADER, not found.determined))
    return tuple(text for text, holds in doubts if holds)


def _fields(
    facts: ViewFacts,
    mesh: BlockMesh,
    nipple: Points,
    start: ViewGeometry,
    found: PoseEstimate | None,
    estimated: tuple[str, ...],
    flags: tuple[str, ...],
) -> Fields:
    """What the artefact keeps; without an estimate the view stays where it started."""
    view = start if found is None else found.view
    return PoseFields(
        view=view,
        rigid=rigid_geometry(mesh, start, facts, nipple),
        maps=affine_maps(mesh, start, view, facts),
        outline=facts.image,
        mammogram=facts.mammogram,
        tissue=facts.tissue,
        storage=facts.storage,
        plates_known=facts.placed,
        drawn_mm=_drawn_mm(facts, view),
        estimated=estimated,
        flags=(*facts.flags, *flags),
        values={
            **facts.values,
            "header_angle_deg": facts.geometry.angle_deg,
            "angle_determined": facts.placed or (found is not None and found.determined),
            **({} if found is None else _search_values(found)),
        },
    ).fields()


def _drawn_mm(facts: ViewFacts, view: ViewGeometry) -> tuple[float, ...] | None:
    """How far the breast was drawn over the plates: from the model's to the second volume's place, plate axes."""
    if not facts.placed:
        return None
    return facts.geometry.middle_mm - view.middle_mm, facts.geometry.edge_p_mm - view.edge_p_mm, 0.0


def _search_values(found: PoseEstimate) -> dict[str, Value]:
    return {
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


STAGE = Stage(
    name="pose", schema=1, inputs=("segment", "mesh", "calibrate"), optional=("image",), settings=Settings, run=run
)
