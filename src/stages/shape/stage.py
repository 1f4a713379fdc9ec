"""Stage `shape`: 3-D surface of the compressed breast from the compression and the mammogram's outline (II-C)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.geometry.frames import Points
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.alignment import Alignment
from mammoreg.shape.estimate import estimate_shape
from stages.compress.record import memory_arrays, resumed
from stages.deformed import force_values, mesh_values
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.methods import block_mesh, pose_outline, view_geometry

Nodes = NDArray[np.int64]
TOUCHING_MM = 1.0
_FACTS = (
    "penetration_mm",
    "volume_change",
    "min_det_f",
    "force_n",
    "force_lower_n",
    "force_upper_n",
    "contact_lost",
    "folded_corners",
    "folded_share",
    "folded_corner_points",
    "sideways_drift_mm",
)


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
    mesh_file, pose, compress = (inputs.artefact(name) for name in ("mesh", "pose", "compress"))
    mesh = block_mesh(mesh_file)
    view, lift_mm = view_geometry(pose), float(compress.value("lift_mm"))
    closing, closed = resumed(mesh_file, compress)
    nodes = np.union1d(mesh.skin_nodes(), _on_plates(mesh.back_nodes(), closing, closed))
    if not pose.has("outline"):
        deformed, facts = compress.array("deformed", "mm"), {name: compress.value(name) for name in _FACTS}
        return _fields(nodes, deformed, closed, {"rounds": 0, **facts})
    outline = pose_outline(pose)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), settings.facets)
    floating = replace(view, height_mm=view.height_mm - lift_mm)
    found = estimate_shape(
        closing,
        closed,
        mesh.skin_quads(),
        facets,
        floating,
        outline,
        settings.tie_stiffness * float(compress.value("stiffness_ratio")),
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
    lifted = found.closed.deformed + np.array([0.0, 0.0, lift_mm])
    values |= force_values(found.closed.force_n) | mesh_values(mesh_file, lifted, view.angle_deg)
    return _fields(nodes, lifted, found.closed, values)


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


def _fields(nodes: Nodes, deformed: Points, closed: Closed, values: dict[str, Value]) -> Fields:
    return Fields(
        arrays={
            "surface_nodes": Array(nodes, "1", "numbers of the mesh nodes on the skin, and of the back on the plates"),
            "surface": Array(deformed[nodes], "mm", "estimated places of these nodes, plate frame"),
            "deformed": Array(deformed, "mm", "all mesh nodes as the surface was estimated, plate frame"),
            "pressure": Array(closed.state.pressure, "kPa", "element pressures there, positive in tension"),
            **memory_arrays(closed.state.memory),
        },
        values=values,
    )


STAGE = Stage(name="shape", schema=3, inputs=("mesh", "pose", "compress"), settings=Settings, run=run)
