"""The solver's stability over laws, Poisson's ratios, compressions, meshes, contrasts, shapes and frictions."""

from typing import Any

from stages.engine.contract import Fields, Inputs, NoSettings, Stage, Subject
from stages.formats.pages import as_csv, as_html, as_markdown, cells
from stages.formats.table import Table
from stages.studies.stability.summary import Row, summary, with_mesh_trend

COLUMNS = (
    *("scenario", "material", "nu", "compression", "elements", "contrast", "shape", "friction", "converged"),
    *("checks_passed", "newton_iterations", "load_steps", "min_jacobian", "volume_change", "force_n", "wall_s"),
    "message",
)
TABLE = Table(
    "stability",
    "Stability of the solver",
    "stability_batch",
    "rows",
    (),
    {"compression": 2, "min_jacobian": 3, "volume_change": 6, "force_n": 3, "wall_s": 2},
    order=COLUMNS,
)
_PICTURE = (
    b'</h1><p><img src="../figures/stability.png" style="max-width:100%" alt="Newton iterations of each scenario"></p>'
)


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Write `tables/stability.csv`, a page that says what it shows, and the picture."""
    rows = with_mesh_trend(_rows(inputs))
    first, sections = summary(rows)
    page = as_html(TABLE.title, first, sections).replace(b"</h1>", _PICTURE, 1)
    files = {
        f"tables/{TABLE.name}.csv": as_csv(TABLE.columns, cells(TABLE, rows)),
        f"tables/{TABLE.name}.md": as_markdown(TABLE.title, first, sections),
        f"tables/{TABLE.name}.html": page,
        f"figures/{TABLE.name}.png": _picture(rows),
    }
    return Fields(files=files, values={"rows": rows, "summary": list(first)}, **_status(first))


def _rows(inputs: Inputs) -> list[Row]:
    """The rows of all batches by name."""
    rows: list[Row] = [dict(row) for row in TABLE.rows(inputs.artefacts("stability_batch"))]
    return sorted(rows, key=lambda row: row["scenario"])


def _status(first: list[str]) -> dict[str, Any]:
    """A study whose figures are not met has failed, with what is to be said first."""
    return {"status": "failed", "message": f"stability: {first[0]}"} if first[0].startswith("Not met") else {}


def _picture(rows: list[Row]) -> bytes:
    # Only this function pays for matplotlib.
    from mammoreg.plots.stability import stability_map

    return stability_map(rows).tobytes()


STAGE = Stage(
    name="stability",
    schema=1,
    inputs=("stability_batch",),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    folder=".",
)
