"""Stage `pose`: where the breast lay between the plates: projection angle, imaged portion and plates (section III)."""

from dataclasses import replace
from functools import partial

import numpy as np
from pydantic import Field

from mammoreg.arrays import Points
from mammoreg.errors import NotConvergedError
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.dense_tissue import dense_tissue
from mammoreg.pose.estimate import PoseEstimate
from mammoreg.pose.outlined import OutlinedView
from mammoreg.pose.row_order import pose_in_order
from mammoreg.pose.search import FoundPose, PoseSearch, find_pose
from stages.calibrate.record import CalibrateRecord
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value, source
from stages.mechanics import CoarseMechanics
from stages.mesh.record import MeshRecord
from stages.pose.affine import affine_maps, rigid_geometry
from stages.pose.record import PoseFields
from stages.pose.size import check_imaged_volume, check_size
from stages.pose.view_facts import ViewFacts, facts_of_mammogram, facts_of_second_volume, view_of
from stages.pose.without_image import without_image
from stages.segment.record import SegmentRecord

ANGLE_AT_BOUND = "angle at its bound"
ANGLE_FROM_HEADER = "angle not determined by the image"
THICKNESS_AT_BOUND = "estimated thickness at the bound of its search"
NOT_DRAWN = "breast not drawn to the second volume's outline, for the coarse compression did not converge"


class Settings(SettingsModel):
    """Search for the pose with a coarse compression of a homogeneous breast without skin."""

    mechanics: CoarseMechanics = Field(CoarseMechanics(), description="plates and back of the coarse compression")
    angle_step_deg: float = Field(
        4.0,
        ge=0.0,
        le=20.0,
        description="distance of the angles tried, degrees; 0 keeps the header's angle",
        json_schema_extra=source("chosen: a parabola through three of them finds the best"),
    )
    angle_bound_deg: float = Field(
        16.0,
        gt=0.0,
        le=45.0,
        description="largest offset from the header's angle, degrees",
        json_schema_extra=source("chosen: four steps, a little more than three standard deviations"),
    )
    angle_sd_deg: float = Field(
        5.0,
        gt=0.0,
        le=30.0,
        description="standard deviation of the header's angle, degrees",
        json_schema_extra=source("chosen: how far a breast may be turned on the support unseen by the header"),
    )
    use_density: bool = Field(True, description="let dense tissue judge the angle beside the outline")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Estimate the pose of one view."""
    segment, mesh = SegmentRecord(inputs.artefact("segment")), MeshRecord(inputs.artefact("mesh")).block
    image, second = inputs.path("image"), segment.compressed_mask
    mu_kpa = CalibrateRecord(inputs.artefact("calibrate")).mu_kpa
    dense = settings.use_density and image is not None
    find = partial(
        find_pose,
        mesh=mesh,
        mechanics=settings.mechanics.of_patient(segment.back_layer_mm).numerics(),
        mu_kpa=mu_kpa,
        tissue=dense_tissue(segment.labels, segment.breast_mask, mesh) if dense else None,
        search=PoseSearch(settings.angle_step_deg, settings.angle_bound_deg, settings.angle_sd_deg),
    )
    if image is None:
        if second is None:
            return without_image(mesh, subject)
        facts = facts_of_second_volume(second)
        return _fields(facts, mesh, segment.nipple, find(facts.seen))
    shown, orders = facts_of_mammogram(image, subject)
    sizes = [check_imaged_volume(facts, segment) for facts in shown]
    posed = pose_in_order(orders, find, subject.laterality, view_of(subject))
    facts, (size, odd) = shown[posed.chosen], sizes[posed.chosen]
    facts = replace(facts, flags=(*facts.flags, *posed.doubts, *odd), values={**facts.values, **size})
    return _fields(facts, mesh, segment.nipple, posed.found)


def _doubts(facts: ViewFacts, found: FoundPose) -> tuple[str, ...]:
    """What speaks against the pose, in words.

    Raises:
        NotConvergedError: there is no pose, and no second volume that stands for one.
    """
    if facts.seen.placed:
        return (NOT_DRAWN,) if found.estimate is None else ()
    if found.estimate is None:
        raise NotConvergedError("the coarse compression converged at none of the angles tried, so the pose is unknown")
    thickness = found.start.thickness
    doubts = (
        (THICKNESS_AT_BOUND, thickness is not None and thickness.at_bound),
        (ANGLE_AT_BOUND, found.estimate.at_bound),
        (ANGLE_FROM_HEADER, not found.estimate.determined),
    )
    odd = check_size(found.estimate.size, found.estimate.view)
    return (*odd, *(text for text, holds in doubts if holds))


def _fields(facts: ViewFacts, mesh: BlockMesh, nipple: Points, found: FoundPose) -> Fields:
    """What the artefact keeps; without an estimate the view stays where it started."""
    doubts = _doubts(facts, found)
    start, estimate, seen = found.start.view, found.estimate, facts.seen
    view = start if estimate is None else estimate.view
    guessed = ("thickness_mm",) if found.start.thickness is not None else ()
    return PoseFields(
        view=view,
        rigid=rigid_geometry(mesh, start, seen, nipple),
        maps=affine_maps(mesh, start, view, seen),
        outline=facts.image,
        mammogram=facts.mammogram,
        tissue=facts.tissue,
        storage=facts.storage,
        plates_known=seen.placed,
        drawn_mm=_drawn_mm(seen, view),
        estimated=tuple(dict.fromkeys((*facts.estimated, *guessed))),
        flags=(*facts.flags, *doubts),
        values={
            **facts.values,
            "header_angle_deg": seen.geometry.angle_deg,
            "angle_determined": seen.placed or (estimate is not None and estimate.determined),
            **({} if estimate is None else _search_values(estimate)),
        },
    ).fields()


def _drawn_mm(seen: OutlinedView, view: ViewGeometry) -> tuple[float, ...] | None:
    """How far the breast was drawn over the plates: from the model's to the second volume's place, plate axes."""
    if not seen.placed:
        return None
    return seen.geometry.middle_mm - view.middle_mm, seen.geometry.edge_p_mm - view.edge_p_mm, 0.0


def _search_values(found: PoseEstimate) -> dict[str, Value]:
    return {
        "relative_size": round(found.size, 4),
        "angle_sd_deg": found.angle_sd_deg if np.isfinite(found.angle_sd_deg) else None,
        "coarse_rms_mm": found.alignment.rms_mm,
        "tried": [
            {
                "angle_deg": c.angle_deg,
                "outline_rms_mm": c.alignment.rms_mm,
                "outline_robust_mm": c.alignment.robust_mm,
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
