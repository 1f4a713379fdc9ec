"""Stage `solve`: the breast again with its surface's displacements as boundary conditions (II-C, updated)."""

from pydantic import Field

from mammoreg.breast.interior import plates_around, solve_interior
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from stages.compress.record import CompressRecord
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject
from stages.mesh.record import MeshRecord
from stages.shape.record import ShapeRecord
from stages.solution import force_values, mesh_values, report_values, seconds_text


class Settings(SettingsModel):
    """When the interior is in equilibrium."""

    residual: float = Field(1e-4, gt=0.0, le=0.1, description="largest ratio of unbalanced to internal forces")
    increment_mm: float = Field(0.02, gt=0.0, le=1.0, description="largest last displacement, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Prescribe the estimated surface and solve the interior; back and plates act as in `compress`."""
    compress, shape = CompressRecord(inputs.artefact("compress")), ShapeRecord(inputs.artefact("shape"))
    # The back's springs and the plates know the floating breast, not where the pose has lifted it to.
    mesh, frame, nodes = MeshRecord(inputs.artefact("mesh")), compress.frame, shape.surface_nodes
    breast, newton = compress.placed(mesh.block), NewtonOptions(settings.residual, settings.increment_mm)
    gap_mm, raised_mm = compress.thickness_mm, compress.raised_mm
    plates = plates_around(mesh.block, breast, compress.closing(breast), gap_mm, raised_mm, shape.memory)
    surface, start = frame.from_plate(shape.surface), frame.from_plate(shape.deformed)
    solved = solve_interior(breast, plates, nodes, surface, start, shape.pressure, newton)
    print(seconds_text(solved.report), flush=True)
    deformed = frame.to_plate(solved.deformed)
    return Fields(
        arrays={"deformed": Array(deformed, "mm", "mesh nodes under the estimated surface, plate frame", "plate")},
        values={
            **report_values(solved.report),
            **force_values(plates.force_n(solved.deformed, solved.node_reaction_n, nodes)),
            **mesh_values(mesh, deformed, compress.angle_deg),
            "penetration_mm": plates.penetration_mm(solved.deformed),
            "residuals": [float(r) for r in solved.residuals],
            "thickness_mm": compress.thickness_mm,
            "angle_deg": compress.angle_deg,
        },
    )


STAGE = Stage(name="solve", schema=4, inputs=("mesh", "compress", "shape"), settings=Settings, run=run)
