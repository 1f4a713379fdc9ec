"""Stage `solve`: the breast again with its surface's displacements as boundary conditions (II-C, updated)."""

import numpy as np
from pydantic import Field

from mammoreg.breast.placed import PlacedBreast
from mammoreg.fem.parts.standing_plates import StandingPlates
from mammoreg.fem.plates.standing import standing_plates
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.solve import PrescribedOptions, solve_prescribed
from mammoreg.meshing.block import BlockMesh
from stages.compress.record import CompressRecord, report_values, seconds_text
from stages.deformed import force_values, mesh_values
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject
from stages.mesh.record import MeshRecord
from stages.shape.record import ShapeRecord


class Settings(SettingsModel):
    """When the interior is in equilibrium."""

    residual: float = Field(1e-4, gt=0.0, le=0.1, description="largest ratio of unbalanced to internal forces")
    increment_mm: float = Field(0.02, gt=0.0, le=1.0, description="largest last displacement, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Prescribe the estimated surface and solve the interior; back and plates act as in `compress`."""
    compress, shape = CompressRecord(inputs.artefact("compress")), ShapeRecord(inputs.artefact("shape"))
    # The back's springs and the plates know the floating breast, not where the pose has lifted it to.
    mesh, frame = MeshRecord(inputs.artefact("mesh")), compress.frame
    breast, nodes = compress.placed(mesh.block), shape.surface_nodes
    plates = _plates(breast, mesh.block, compress, shape)
    solved = solve_prescribed(
        breast.model,
        nodes,
        frame.from_plate(shape.surface),
        breast.back,
        start=frame.from_plate(shape.deformed),
        pressure=shape.pressure,
        parts=(*breast.loads, plates.beside(nodes)),
        options=PrescribedOptions(newton=NewtonOptions(residual=settings.residual, increment_mm=settings.increment_mm)),
    )
    print(seconds_text(solved.report), flush=True)
    deformed = frame.to_plate(solved.deformed)
    return Fields(
        arrays={"deformed": Array(deformed, "mm", "mesh nodes under the estimated surface, plate frame")},
        values={
            **report_values(solved.report),
            **force_values(plates.force_n(solved.deformed, solved.node_reaction_n, nodes)),
            **mesh_values(mesh, deformed, compress.angle_deg),
            "penetration_mm": plates.penetration_mm(solved.deformed),
            "residuals": [float(r) for r in solved.residuals],
            "thickness_mm": compress.thickness_mm,
        },
    )


def _plates(breast: PlacedBreast, mesh: BlockMesh, compress: CompressRecord, shape: ShapeRecord) -> StandingPlates:
    """The plates as the surface was estimated between them, on the faces of skin and back."""
    faces = np.concatenate([mesh.skin_quads(), breast.back_quads])
    return standing_plates(compress.closing(breast), faces, compress.thickness_mm, compress.raised_mm, shape.memory)


STAGE = Stage(name="solve", schema=4, inputs=("mesh", "compress", "shape"), settings=Settings, run=run)
