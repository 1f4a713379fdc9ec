"""Table and picture of the study of error against computing time, from the cases' `runtime`."""

from typing import Any

from stages.engine.artefact import Fields
from stages.engine.contract import Inputs, NoSettings, Stage, Subject
from stages.formats.pages import as_csv, cells
from stages.formats.table import Table

TABLE = Table(
    "error_vs_runtime",
    "Error against computing time",
    "runtime",
    "rows",
    ("view", "method", "material", "elements"),
    {"error_mm": 3, "discretisation_mm": 3, "solve_s": 2, "total_s": 2, "peak_mb": 0},
    ("failed",),
)


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Write `tables/error_vs_runtime.csv`, and the picture where anything has a truth."""
    rows = TABLE.rows(inputs.artefacts("runtime"))
    files = {f"tables/{TABLE.name}.csv": as_csv(TABLE.columns, cells(TABLE, rows))}
    if any(row["error_mm"] is not None for row in rows):
        files[f"figures/{TABLE.name}.png"] = _picture(rows)
    return Fields(files=files, values={"rows": [dict(row) for row in rows]})


def _picture(rows: Any) -> bytes:
    # Only this function pays for matplotlib.
    from mammoreg.plots.accuracy import RuntimePoint, error_against_runtime

    points = [
        RuntimePoint(row["method"], row["view"], row["elements"], row["error_mm"], row["total_s"])
        for row in rows
        if row["error_mm"]
    ]
    return error_against_runtime(points).tobytes()


STAGE = Stage(
    name="error_vs_runtime",
    schema=1,
    inputs=("runtime",),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    folder=".",
)
