"""Stage `shape`: 3-D surface of the compressed breast from the compression and the mammogram's outline (II-C)."""

import numpy as np
from pydantic import Field

from mammoreg.pose.alignment import Alignment
from mammoreg.shape.estimate import ShapeEstimate
from mammoreg.shape.surface import DrawnSurface, ShapeOptions, drawn_surface
from stages.compress.record import CompressRecord
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value, source
from stages.mesh.record import MeshRecord
from stages.pose.record import PoseRecord
from stages.shape.record import shape_fields
from stages.solution import force_values, mesh_values

_LIBRARY = ShapeOptions()


class Settings(SettingsModel):
    """How the silhouette is drawn onto the outline."""

    tie_stiffness: float = Field(
        _LIBRARY.tie_stiffness,
        gt=0.0,
        le=1000.0,
        description="stiffness of the outline's ties in units of the shear modulus",
        json_schema_extra=source("chosen: the ties win over the tissue"),
    )
    rounds: int = Field(
        _LIBRARY.rounds,
        ge=0,
        le=20,
        description="renewals of the ties at most",
        json_schema_extra=source("chosen: a bound on the work"),
    )
    settled_mm: float = Field(
        _LIBRARY.settled_mm,
        gt=0.0,
        le=5.0,
        description="mean misfit at which the silhouette is settled, mm",
        json_schema_extra=source("chosen: small beside a voxel"),
    )
    facets: int = Field(_LIBRARY.facets, ge=1, le=8, description="facets per face and side for silhouettes")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Estimate the surface; without an outline it is that of the compression."""
    mesh_record, pose = MeshRecord(inputs.artefact("mesh")), PoseRecord(inputs.artefact("pose"))
    mesh, compress = mesh_record.block, CompressRecord(inputs.artefact("compress"))
    closing, closed = compress.resumed(mesh)
    outline = pose.outline() if pose.has_outline else None
    floating, options = compress.frame.view(pose.geometry), ShapeOptions(**settings.plain())
    drawn = drawn_surface(mesh, closing, closed, floating, outline, compress.stiffness_ratio, options)
    if drawn.estimate is None:
        return shape_fields(
            drawn.nodes,
            compress.deformed,
            closed.state,
            {"rounds": 0, "angle_deg": compress.angle_deg, **compress.facts()},
        )
    deformed = compress.frame.to_plate(drawn.closed.deformed)
    values = {"angle_deg": compress.angle_deg} | _values(drawn, drawn.estimate)
    values |= mesh_values(mesh_record, deformed, pose.geometry.angle_deg)
    return shape_fields(drawn.nodes, deformed, drawn.closed.state, values)


def _values(drawn: DrawnSurface, found: ShapeEstimate) -> dict[str, Value]:
    return {
        "rounds": found.rounds,
        **_misfit("before", found.before),
        **_misfit("after", found.after),
        "contact_drift_mm": drawn.contact_drift_mm,
        "penetration_mm": drawn.closed.penetration_mm,
        "volume_change": drawn.closed.volume_change,
        "min_det_f": drawn.closed.min_det_f,
        **force_values(drawn.closed.force_n),
    }


def _misfit(when: str, state: Alignment) -> dict[str, Value]:
    """Mean and 95th percentile of the misfit where the outline is skin and fully trusted."""
    gap = np.abs(state.gap_mm[state.weight > 0.99])
    if not len(gap):
        return {f"outline_{when}_mean_mm": None, f"outline_{when}_p95_mm": None}
    return {
        f"outline_{when}_mean_mm": float(gap.mean()),
        f"outline_{when}_p95_mm": float(np.quantile(gap, 0.95)),
    }


STAGE = Stage(name="shape", schema=3, inputs=("mesh", "pose", "compress"), settings=Settings, run=run)
