"""Stage `project`: the breast as each method deforms it, and what it would show on the mammogram's detector."""

from pydantic import Field

from mammoreg.projection.comparison import projection_correlation
from mammoreg.projection.method import deform_breast, project_breast, tissue_of_labels
from stages.engine.artefact import Array, Fields, Value, VolumeField
from stages.engine.contract import Inputs, SettingsModel, Stage, Subject
from stages.methods import MESH_METHODS, method_views, reference_mesh

_SOLUTIONS = tuple(MESH_METHODS.values())


class Settings(SettingsModel):
    """Resolution of the deformed volume and of its projection."""

    grid_mm: float = Field(1.4, ge=0.4, le=4.0, description="voxels of the deformed MR volume, mm")
    detector_mm: float = Field(0.8, ge=0.1, le=4.0, description="pixels of the projection at the detector, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Deform and project by every method whose solution is at hand; the message of one that failed is passed on."""
    segment, mesh, pose = required = [inputs.artefact(name) for name in ("segment", "mesh", "pose")]
    solutions = [artefact for name in _SOLUTIONS for artefact in inputs.artefacts(name)]
    for artefact in required:
        if not artefact.ok:
            return Fields(failure=artefact.failure)
    labels, breast_mask, mr = (
        segment.volume(name).to_breast(segment.laterality) for name in ("labels", "breast_mask", "mr")
    )
    tissue, reference = tissue_of_labels(labels, breast_mask), reference_mesh(mesh)
    step = max(1, round(settings.detector_mm / float(pose.value("pixel_mm"))))
    arrays: dict[str, Array] = {}
    volumes: dict[str, VolumeField] = {}
    values: dict[str, Value] = {"step": step}
    for name, method in method_views(pose, reference, solutions).items():
        breast = deform_breast(method, reference.points, settings.grid_mm)
        image, mask = project_breast(breast, tissue, method, step)
        arrays[f"{name}/projection"] = Array(image, "1", f"attenuation at 20 keV, method {name}, by blocks of pixels")
        arrays[f"{name}/mask"] = Array(mask, "1", f"silhouette of the breast, method {name}, by blocks of pixels")
        if pose.has("mammogram"):
            shown, outlined = pose.array("mammogram", "1"), pose.array("breast_mask", "1")
            values[f"{name}_ncc"] = projection_correlation(image, mask, shown, outlined, step)
        if name in MESH_METHODS:
            volumes[f"{name}/mr"] = VolumeField(breast.carry(mr), "1", f"MR volume, method {name}")
    failure = next((artefact.failure for artefact in solutions if artefact.failure), None)
    return Fields(arrays=arrays, volumes=volumes, values=values, failure=failure)


STAGE = Stage(
    name="project",
    schema=1,
    inputs=("segment", "mesh", "pose"),
    optional=_SOLUTIONS,
    settings=Settings,
    run=run,
    takes_failed=True,
)
