"""Study `table_1`: the paper's Table I twice, by the laws alone and by finite elements of the cube (section II-B)."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from pydantic import Field

from mammoreg.errors import NotConvergedError
from mammoreg.fem.prescribed.cube import Faces, press_cube
from mammoreg.materials.catalogue import CATALOGUE, CatalogueTissue
from mammoreg.materials.cube import HIGH_COMPRESSION, LOW_COMPRESSION, cube_force_n
from mammoreg.materials.elastic import tangent_bulk_kpa
from mammoreg.materials.laws import Law
from stages.engine.contract import Fields, Inputs, SettingsModel, Stage, Subject
from stages.studies.table_1.pages import CubeForces, as_files

ROUTES: dict[str, Faces] = {"fe_sliding": "sliding", "fe_sticking": "sticking"}
_COARSE = 2


class Settings(SettingsModel):
    """Meshes of the cube and its bulk modulus."""

    elements: tuple[int, ...] = Field((7, 14), min_length=1, description="elements a side of each mesh")
    poisson_ratio: float = Field(
        0.499,
        ge=0.49,
        le=0.49999,
        description="ties the bulk modulus to a third of the tangent stiffness that each law has at the final strain",
    )


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Write `tables/table_1_forces` as .csv, .md and .html."""
    names = (("fat", LOW_COMPRESSION), ("gland", HIGH_COMPRESSION))
    found = [
        _forces(model, name, compression, settings.elements, settings.poisson_ratio)
        for model in CATALOGUE
        for name, compression in names
    ]
    rows = [row for forces in found for row in _rows(forces)]
    bulk = [{"model": f.model, "tissue": f.name, "bulk_kpa": f.bulk_kpa} for f in found]
    return Fields(files=as_files(found, rows), values={"rows": rows, "bulk_kpa": bulk})


def _forces(model: str, name: str, compression: float, meshes: Sequence[int], poisson: float) -> CubeForces:
    """One entry of the table by all routes."""
    entry = CATALOGUE[model]
    tissue: CatalogueTissue = getattr(entry, name)
    bulk = tangent_bulk_kpa(tissue.law, compression, poisson)
    once, twice = (_cube_n(tissue.law, factor * bulk, compression, _COARSE, "sliding") for factor in (1.0, 2.0))
    return CubeForces(
        model=model,
        name=name,
        tissue=tissue,
        compression=compression,
        paper_n=entry.table_1.get(name),
        bulk_kpa=bulk,
        stiffer_n=None if once is None or twice is None else twice - once,
        law_n=cube_force_n(tissue.law, compression),
        elements_n={
            route: {n: _cube_n(tissue.law, bulk, compression, n, faces) for n in sorted(meshes)}
            for route, faces in ROUTES.items()
        },
    )


@cache
def _cube_n(law: Law, bulk_kpa: float, compression: float, elements: int, faces: Faces) -> float | None:
    """Force by finite elements, None without an equilibrium; models share tissues, whose cube is pressed once."""
    try:
        return press_cube(law, bulk_kpa, compression, elements, faces).force_n
    except NotConvergedError:
        return None


def _rows(found: CubeForces) -> list[dict[str, Any]]:
    """Rows of the CSV: finite elements by the finest mesh."""
    forces = {"law": found.law_n, **{route: list(by_mesh.values())[-1] for route, by_mesh in found.elements_n.items()}}
    return [
        {
            "model": found.model,
            "tissue": found.name,
            "compression": found.compression,
            "route": route,
            "force_n": force,
            "paper_n": found.paper_n,
            "independent": found.tissue.independent,
        }
        for route, force in forces.items()
    ]


STAGE = Stage(name="table_1", schema=1, inputs=(), settings=Settings, run=run, folder=".")
