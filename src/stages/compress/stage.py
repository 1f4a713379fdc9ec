"""Stage `compress`: the breast between two rigid plates (paper, section II-C, plate compression)."""

from dataclasses import replace
from typing import Literal

from pydantic import Field

from mammoreg.breast.compression import prepare_compression
from mammoreg.errors import DataError
from mammoreg.fem.plates.closing import ClosingOptions
from stages.calibrate.record import CalibrateRecord
from stages.compress.gland_map import gland_share
from stages.compress.record import CompressFields
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, source
from stages.mechanics import Mechanics
from stages.mesh.record import MeshRecord
from stages.pose.record import PoseRecord
from stages.segment.record import SegmentRecord
from stages.solution import seconds_text


class Settings(SettingsModel):
    """Mechanics, and how the plates close."""

    mechanics: Mechanics = Field(Mechanics(), description="tissue, plates and back")
    stop: Literal["thickness", "force"] = Field(
        "thickness",
        description="where the plates stop: at the thickness of the pose (the paper), or at the force that the "
        "mammogram's header or table gives",
    )
    load_steps: int = Field(
        8, ge=1, le=200, description="load steps at least", json_schema_extra=source("chosen for convergence")
    )
    tolerance_mm: float = Field(
        0.05,
        gt=0.0,
        le=1.0,
        description="Newton iterations end below this displacement, mm",
        json_schema_extra=source("chosen: small beside a voxel"),
    )
    penalty_per_mm: float = Field(
        2.0,
        gt=0.0,
        le=100.0,
        description="stiffness of the contact in units of the shear modulus, 1/mm",
        json_schema_extra=source("chosen for convergence; the contact is stiffened once the plates have closed"),
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Close the plates to the thickness of the pose, or to its force."""
    pose, mesh = PoseRecord(inputs.artefact("pose")), MeshRecord(inputs.artefact("mesh"))
    layer_mm = SegmentRecord(inputs.artefact("segment")).back_layer_mm if inputs.has("segment") else None
    patient = settings.mechanics.of_patient(layer_mm)
    view, mechanics = pose.geometry, patient.numerics()
    mu_kpa = CalibrateRecord(inputs.artefact("calibrate")).mu_kpa
    gland = gland_share(inputs) if mechanics.tells_gland_from_fat else None
    options = replace(
        ClosingOptions(),
        steps=settings.load_steps,
        tolerance_mm=settings.tolerance_mm,
        penalty_per_mm=settings.penalty_per_mm,
    )
    lower_mm = view.height_mm if pose.plates_known else None
    prepared = prepare_compression(mesh.block, view, mechanics, mu_kpa, gland, options, lower_mm)
    by_force = settings.stop == "force"
    closing = prepared.closing
    closed = closing.close_to_force(_force_n(pose)) if by_force else closing.close(view.thickness_mm)
    print(seconds_text(closed.report), flush=True)
    return CompressFields(closed, prepared, view, mesh, patient, mu_kpa, gland).fields()


def _force_n(pose: PoseRecord) -> float:
    """Force that a view's header or table gives.

    Raises:
        DataError: neither does.
    """
    if pose.force_n is None:
        raise DataError(
            "the plates are to stop at a force, but this view has none; give force_n in the views table, or set "
            "compress.stop to thickness"
        )
    return pose.force_n


STAGE = Stage(
    name="compress",
    schema=3,
    inputs=("mesh", "pose", "calibrate"),
    optional=("segment",),
    settings=Settings,
    run=run,
)
