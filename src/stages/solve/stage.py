"""Stage `solve`: the breast again with its surface's displacements as boundary conditions (II-C, updated)."""

import numpy as np
from pydantic import Field

from mammoreg.fem.prescribed.equilibrium import NewtonOptions
from mammoreg.fem.prescribed.solve import PrescribedOptions, solve_prescribed
from stages.compress.record import placed_again
from stages.compress.solve_report import report_values, seconds_text
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject


class Settings(SettingsModel):
    """When the interior is in equilibrium."""

    residual: float = Field(1e-4, gt=0.0, le=0.1, description="largest ratio of unbalanced to internal forces")
    increment_mm: float = Field(0.02, gt=0.0, le=1.0, description="largest last displacement, mm")


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Prescribe the estimated surface and solve the interior; the back keeps the condition of `compress`."""
    compress, shape = inputs.artefact("compress"), inputs.artefact("shape")
    # The back's springs know the floating breast, not where the pose has lifted it to.
    lift = np.array([0.0, 0.0, float(compress.value("lift_mm"))])
    breast = placed_again(inputs.artefact("mesh"), compress)
    solved = solve_prescribed(
        breast.model,
        shape.array("surface_nodes", "1"),
        shape.array("surface", "mm") - lift,
        breast.back,
        start=shape.array("deformed", "mm") - lift,
        pressure=shape.array("pressure", "kPa"),
        parts=breast.loads,
        options=PrescribedOptions(newton=NewtonOptions(residual=settings.residual, increment_mm=settings.increment_mm)),
    )
    print(seconds_text(solved.report), flush=True)
    return Fields(
        arrays={"deformed": Array(solved.deformed + lift, "mm", "mesh nodes under the estimated surface, plate frame")},
        values={
            **report_values(solved.report),
            "residuals": [float(r) for r in solved.residuals],
            "thickness_mm": compress.value("thickness_mm"),
            "force_n": compress.value("force_n"),
        },
    )


STAGE = Stage(name="solve", schema=3, inputs=("mesh", "compress", "shape"), settings=Settings, run=run)
