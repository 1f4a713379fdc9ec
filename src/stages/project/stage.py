"""Stage `project`: the breast as each method deforms it, and what it would show on the mammogram's detector."""

from dataclasses import replace

from pydantic import Field

from mammoreg.projection.comparison import projection_correlation
from mammoreg.projection.method import deform_breast, project_breast, tissue_of_labels
from stages.engine.completion import first_failure
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject
from stages.mesh.record import MeshRecord
from stages.methods import MESH_METHODS, method_views
from stages.pose.record import PoseRecord
from stages.project.record import ProjectFields
from stages.segment.record import SegmentRecord

_SOLUTIONS = tuple(MESH_METHODS.values())


class Settings(SettingsModel):
    """Resolution of the deformed volume and of its projection."""

    grid_mm: float = Field(1.4, ge=0.4, le=4.0, description="voxels of the deformed MR volume, mm")
    detector_mm: float = Field(0.8, ge=0.1, le=4.0, description="pixels of the projection at the detector, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Deform and project by every method whose solution is at hand; the message of one that failed is passed on."""
    required = [inputs.artefact(name) for name in ("segment", "mesh", "pose")]
    solutions = [artefact for name in _SOLUTIONS for artefact in inputs.artefacts(name)]
    if failure := first_failure(required):
        return Fields(failure=failure)
    segment, mesh, pose = SegmentRecord(required[0]), MeshRecord(required[1]), PoseRecord(required[2])
    tissue, mr = tissue_of_labels(segment.labels, segment.breast_mask), segment.mr
    step = max(1, round(settings.detector_mm / pose.geometry.pixel_mm))
    found = ProjectFields(step, pose.geometry.angle_deg)
    for name, method in method_views(pose, mesh.reference, solutions).items():
        breast = deform_breast(method, mesh.reference.points, settings.grid_mm)
        image, mask = project_breast(breast, tissue, method, step)
        seen = projection_correlation(image, mask, pose.mammogram, pose.tissue, step) if pose.has_mammogram else None
        found.add(name, image, mask, seen, breast.carry(mr) if name in MESH_METHODS else None)
    return replace(found.fields(), failure=first_failure(solutions))


STAGE = Stage(
    name="project",
    schema=2,
    inputs=("segment", "mesh", "pose"),
    optional=_SOLUTIONS,
    settings=Settings,
    run=run,
    takes_failed=True,
)
