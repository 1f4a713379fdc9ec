"""Stage `shape`: 3-D surface of the compressed breast from the compression and the mammogram's outline (II-C)."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.alignment import Alignment
from mammoreg.shape.estimate import estimate_shape
from stages.compress.record import CompressRecord
from stages.deformed import force_values, mesh_values
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.mesh.record import MeshRecord
from stages.pose.record import PoseRecord
from stages.shape.record import shape_fields

Nodes = NDArray[np.int64]
TOUCHING_MM = 1.0


class Settings(SettingsModel):
    """How the silhouette is drawn onto the outline."""

    tie_stiffness: float = Field(
        20.0, gt=0.0, le=1000.0, description="stiffness of the outline's ties in units of the shear modulus"
    )
    rounds: int = Field(4, ge=0, le=20, description="renewals of the ties at most")
    settled_mm: float = Field(0.1, gt=0.0, le=5.0, description="mean misfit at which the silhouette is settled, mm")
    facets: int = Field(3, ge=1, le=8, description="facets per face and side for silhouettes")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Estimate the surface; without an outline it is that of the compression."""
    mesh_record, pose = MeshRecord(inputs.artefact("mesh")), PoseRecord(inputs.artefact("pose"))
    mesh, compress = mesh_record.block, CompressRecord(inputs.artefact("compress"))
    closing, closed = compress.resumed(mesh)
    nodes = np.union1d(mesh.skin_nodes(), _on_plates(mesh.back_nodes(), closing, closed))
    if not pose.has_outline:
        return shape_fields(nodes, compress.deformed, closed.state, {"rounds": 0, **compress.facts()})
    found = estimate_shape(
        closing,
        closed,
        mesh.skin_quads(),
        skin_facets(mesh.skin_quads(), len(mesh.points), settings.facets),
        compress.frame.view(pose.geometry),
        pose.outline(),
        settings.tie_stiffness * compress.stiffness_ratio,
        settings.rounds,
        settings.settled_mm,
    )
    values = {"rounds": found.rounds, **_misfit("before", found.before), **_misfit("after", found.after)}
    values |= {
        "contact_drift_mm": _drift(_on_plates(mesh.skin_nodes(), closing, closed), closed, found.closed),
        "penetration_mm": found.closed.penetration_mm,
        "volume_change": found.closed.volume_change,
        "min_det_f": found.closed.min_det_f,
    }
    deformed = compress.frame.to_plate(found.closed.deformed)
    values |= force_values(found.closed.force_n) | mesh_values(mesh_record, deformed, pose.geometry.angle_deg)
    return shape_fields(nodes, deformed, found.closed.state, values)


def _misfit(when: str, state: Alignment) -> dict[str, Value]:
    """Mean and 95th percentile of the misfit where the outline is skin and fully trusted."""
    gap = np.abs(state.gap_mm[state.weight > 0.99])
    if not len(gap):
        return {f"outline_{when}_mean_mm": None, f"outline_{when}_p95_mm": None}
    return {
        f"outline_{when}_mean_mm": float(gap.mean()),
        f"outline_{when}_p95_mm": float(np.quantile(gap, 0.95)),
    }


def _on_plates(nodes: Nodes, closing: Closing, closed: Closed) -> Nodes:
    """Those of `nodes` (B,) that lie on the plates' flat faces."""
    flat = nodes if closing.edge is None else nodes[closed.deformed[nodes, 1] < closing.edge - closing.lip]
    height = closed.deformed[flat, 2] - closed.height_mm
    return np.asarray(flat[(height < TOUCHING_MM) | (height > closed.gap_mm - TOUCHING_MM)])


def _drift(nodes: Nodes, before: Closed, after: Closed) -> float:
    """Largest motion along the compression of nodes (B,) that lay on the plates, mm."""
    heights = [closed.deformed[nodes, 2] - closed.height_mm for closed in (before, after)]
    return float(np.abs(heights[1] - heights[0]).max(initial=0.0))


STAGE = Stage(name="shape", schema=3, inputs=("mesh", "pose", "compress"), settings=Settings, run=run)
