"""Stage `solve`: the breast again with its surface's displacements as boundary conditions (II-C, updated)."""

import numpy as np
from pydantic import Field

from mammoreg.breast.placed import PlacedBreast
from mammoreg.fem.parts.standing_plates import StandingPlates
from mammoreg.fem.plates.standing import standing_plates
from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.solve import PrescribedOptions, solve_prescribed
from stages.compress.record import closing_again, kept_memory, placed_again
from stages.compress.solve_report import report_values, seconds_text
from stages.deformed import force_values, mesh_values
from stages.engine.artefact import Artefact
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject
from stages.methods import block_mesh


class Settings(SettingsModel):
    """When the interior is in equilibrium."""

    residual: float = Field(1e-4, gt=0.0, le=0.1, description="largest ratio of unbalanced to internal forces")
    increment_mm: float = Field(0.02, gt=0.0, le=1.0, description="largest last displacement, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Prescribe the estimated surface and solve the interior; back and plates act as in `compress`."""
    mesh, compress, shape = (inputs.artefact(name) for name in ("mesh", "compress", "shape"))
    # The back's springs and the plates know the floating breast, not where the pose has lifted it to.
    lift = np.array([0.0, 0.0, float(compress.value("lift_mm"))])
    breast, nodes = placed_again(mesh, compress), shape.array("surface_nodes", "1")
    plates = _plates(breast, mesh, compress, shape)
    solved = solve_prescribed(
        breast.model,
        nodes,
        shape.array("surface", "mm") - lift,
        breast.back,
        start=shape.array("deformed", "mm") - lift,
        pressure=shape.array("pressure", "kPa"),
        parts=(*breast.loads, plates.beside(nodes)),
        options=PrescribedOptions(newton=NewtonOptions(residual=settings.residual, increment_mm=settings.increment_mm)),
    )
    print(seconds_text(solved.report), flush=True)
    deformed = solved.deformed + lift
    return Fields(
        arrays={"deformed": Array(deformed, "mm", "mesh nodes under the estimated surface, plate frame")},
        values={
            **report_values(solved.report),
            **force_values(plates.force_n(solved.deformed, solved.node_reaction_n, nodes)),
            **mesh_values(mesh, deformed, float(compress.value("angle_deg"))),
            "penetration_mm": plates.penetration_mm(solved.deformed),
            "residuals": [float(r) for r in solved.residuals],
            "thickness_mm": compress.value("thickness_mm"),
        },
    )


def _plates(breast: PlacedBreast, mesh: Artefact, compress: Artefact, shape: Artefact) -> StandingPlates:
    """The plates as the surface was estimated between them, on the faces of skin and back."""
    faces = np.concatenate([block_mesh(mesh).skin_quads(), breast.back_quads])
    gap_mm, height_mm = float(compress.value("thickness_mm")), float(compress.value("raised_mm"))
    return standing_plates(closing_again(breast, compress), faces, gap_mm, height_mm, kept_memory(shape))


STAGE = Stage(name="solve", schema=4, inputs=("mesh", "compress", "shape"), settings=Settings, run=run)
