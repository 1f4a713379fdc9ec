"""Stage `shape`: 3-D surface of the compressed breast from the compression and the mammogram's outline (II-C)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.geometry.frames import Points
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.alignment import Alignment
from mammoreg.shape.estimate import estimate_shape
from stages.closing import resumed
from stages.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.methods import block_mesh, pose_outline, view_geometry


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
    if not pose.has("outline"):
        return _fields(mesh, compress.array("deformed", "mm"), compress.array("pressure", "kPa"), {"rounds": 0})
    view, lift_mm = view_geometry(pose), float(compress.value("lift_mm"))
    outline = pose_outline(pose)
    closing, closed = resumed(mesh_file, compress, view.edge_p_mm)
    facets = skin_facets(mesh.skin_quads(), len(mesh.points), settings.facets)
    floating = replace(view, height_mm=view.height_mm - lift_mm)
    found = estimate_shape(
        closing,
        closed,
        mesh.skin_quads(),
        facets,
        floating,
        outline,
        settings.tie_stiffness * float(compress.value("stiffening")),
        settings.rounds,
        settings.settled_mm,
    )
    values = {"rounds": found.rounds, **_misfit("before", found.before), **_misfit("after", found.after)}
    values |= {
        "contact_drift_mm": _drift(closing, mesh.skin_quads(), closed, found.closed),
        "penetration_mm": found.closed.penetration_mm,
        "volume_change": found.closed.volume_change,
    }
    lifted = found.closed.deformed + np.array([0.0, 0.0, lift_mm])
    return _fields(mesh, lifted, found.closed.state.pressure, values | {"min_det_f": found.closed.min_det_f})


def _misfit(when: str, state: Alignment) -> dict[str, Value]:
    """Mean and 95th percentile of the misfit where the outline is skin and fully trusted."""
    gap = np.abs(state.gap_mm[state.weight > 0.99])
    if not len(gap):
        return {f"outline_{when}_mean_mm": None, f"outline_{when}_p95_mm": None}
    return {
        f"outline_{when}_mean_mm": float(gap.mean()),
        f"outline_{when}_p95_mm": float(np.quantile(gap, 0.95)),
    }


def _drift(closing: Closing, skin_quads: NDArray[np.int64], before: Closed, after: Closed) -> float:
    """Largest motion along the compression of skin nodes that lay on the plates' flat faces, mm."""
    skin = np.unique(skin_quads)
    flat = skin if closing.edge is None else skin[before.deformed[skin, 1] < closing.edge - closing.lip]
    height = before.deformed[flat, 2] - before.height_mm
    touching = (height < 1.0) | (height > before.gap_mm - 1.0)
    motion = np.abs(after.deformed[flat, 2] - after.height_mm - height)[touching]
    return float(motion.max()) if len(motion) else 0.0


def _fields(mesh: BlockMesh, deformed: Points, pressure: Points, values: dict[str, Value]) -> Fields:
    skin = mesh.skin_nodes()
    return Fields(
        arrays={
            "skin_nodes": Array(skin, "1", "numbers of the skin's mesh nodes"),
            "surface": Array(deformed[skin], "mm", "estimated places of the skin's nodes, plate frame"),
            "deformed": Array(deformed, "mm", "all mesh nodes as the surface was estimated, plate frame"),
            "pressure": Array(pressure, "kPa", "element pressures there, positive in tension"),
        },
        values=values,
    )


STAGE = Stage(name="shape", schema=1, inputs=("mesh", "pose", "compress"), settings=Settings, run=run)
