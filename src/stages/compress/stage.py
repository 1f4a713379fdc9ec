"""Stage `compress`: the breast between two rigid plates (paper, section II-C, plate compression)."""

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import closing_plates, place_breast
from mammoreg.contact.soft import touching
from mammoreg.errors import DataError
from mammoreg.fem.plates.closing import Closed, ClosingOptions
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.meshing.block import BlockMesh
from stages.compress.gland_map import gland_share, gland_share_array
from stages.compress.record import kept_arrays, kept_values
from stages.compress.solve_report import report_values, seconds_text
from stages.deformed import force_values, mesh_values
from stages.engine.artefact import Artefact
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject, Value
from stages.mechanics import Mechanics
from stages.methods import block_mesh, view_geometry


class Settings(SettingsModel):
    """Mechanics, and how the plates close."""

    mechanics: Mechanics = Field(Mechanics(), description="tissue, plates and back")
    stop: Literal["thickness", "force"] = Field(
        "thickness",
        description="where the plates stop: at the thickness of the pose (the paper), or at the force that the "
        "mammogram's header or table gives",
    )
    load_steps: int = Field(8, ge=1, le=200, description="load steps at least")
    tolerance_mm: float = Field(0.05, gt=0.0, le=1.0, description="Newton iterations end below this displacement, mm")
    penalty_per_mm: float = Field(
        2.0, gt=0.0, le=100.0, description="stiffness of the contact in units of the shear modulus, 1/mm"
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Close the plates to the thickness of the pose, or to its force."""
    pose = inputs.artefact("pose")
    view = view_geometry(pose)
    lower_mm = view.height_mm if pose.value("plates_known") else None
    mu_kpa = float(inputs.artefact("calibrate").value("mu_kpa"))
    mechanics = settings.mechanics.numerics()
    gland = gland_share(inputs) if mechanics.tells_gland_from_fat else None
    mesh = block_mesh(inputs.artefact("mesh"))
    compression = _compression(mesh, view, mechanics)
    breast = place_breast(mesh, view.angle_deg, mechanics, mu_kpa, gland, compression)
    options = replace(
        ClosingOptions(),
        steps=settings.load_steps,
        tolerance_mm=settings.tolerance_mm,
        penalty_per_mm=settings.penalty_per_mm * breast.stiffness_ratio,
    )
    closing = closing_plates(breast, view.edge_p_mm, mechanics, options, lower_mm)
    by_force = settings.stop == "force"
    closed = closing.close_to_force(_force_n(pose)) if by_force else closing.close(view.thickness_mm)
    print(seconds_text(closed.report), flush=True)
    # The floating breast is placed where the pose has seen the plates.
    lift = np.array([0.0, 0.0, view.height_mm - closed.height_mm])
    deformed = closed.deformed + lift
    return Fields(
        arrays={
            "deformed": Array(deformed, "mm", "mesh nodes between the plates, plate frame"),
            "residuals": Array(np.array(closed.residuals), "1", "unbalanced over internal forces, each iteration"),
            **kept_arrays(closed, lift),
            **gland_share_array(gland),
        },
        values={
            **closing_report(closed),
            **mesh_values(inputs.artefact("mesh"), deformed, view.angle_deg),
            "height_mm": view.height_mm,
            "lift_mm": float(lift[2]),
            "known_lower_mm": lower_mm,
            "raised_mm": closed.state.height,
            "uncompressed_mm": closing.uncompressed_mm,
            "compression": compression,
            "stiffness_ratio": breast.stiffness_ratio,
            **kept_values(settings.mechanics, options, mu_kpa, view.angle_deg, view.edge_p_mm),
        },
    )


def _compression(mesh: BlockMesh, view: ViewGeometry, mechanics: BreastMechanics) -> float:
    """Share of the thickness between the plates that they take away."""
    skin = breast_to_plate(mesh.points[mesh.skin_nodes()], view.angle_deg)
    low, high = touching(skin, view.edge_p_mm if mechanics.plates_end else None, mechanics.lip_radius_mm)
    return max(0.0, 1.0 - view.thickness_mm / (high - low))


def _force_n(pose: Artefact) -> float:
    """Force that a view's header or table gives.

    Raises:
        DataError: neither does.
    """
    force = pose.value("header_force_n") if pose.has("header_force_n") else None
    if force is None:
        raise DataError(
            "the plates are to stop at a force, but this view has none; give force_n in the views table, or set "
            "compress.stop to thickness"
        )
    return float(force)


def closing_report(closed: Closed) -> dict[str, Value]:
    """What happened in a compression."""
    return {
        "thickness_mm": closed.gap_mm,
        **force_values(closed.force_n),
        "cut_steps": closed.cuts,
        "last_motion_mm": closed.restless_mm,
        "penetration_mm": closed.penetration_mm,
        **report_values(closed.report),
    }


STAGE = Stage(
    name="compress",
    schema=3,
    inputs=("mesh", "pose", "calibrate"),
    optional=("segment",),
    settings=Settings,
    run=run,
)
