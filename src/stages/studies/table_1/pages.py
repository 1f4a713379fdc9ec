"""Table I as a file of values and as pages: forces, bulk moduli, provenance, and what proves nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mammoreg.materials.catalogue import CatalogueTissue
from stages.formats.pages import Section, as_csv, as_html, as_markdown

NAME = "table_1_forces"
TITLE = "Table I: force on a cube of 240 cm3"
COLUMNS = ("model", "tissue", "compression", "route", "force_n", "paper_n", "independent")
_DECIMALS = {"compression": 2, "force_n": 3, "paper_n": 0}
_NOTES = """\
Law: stress times the undeformed face, plates without friction, as in the paper.
K is tied to a third of the tangent stiffness ds/de at the final strain, for Wellman's gland 470 times the initial one.
Sliding faces keep their plane and leave the cube homogeneous, which any mesh holds exactly.
A law that is linear in compression is followed exactly to 48 %, for in shear it would soften from 49.4 % on: +0.2 %.
Sticking faces are glued; sides that fold over their edges pass the plates. The force still falls from mesh to mesh.
Azar's fat hardens from 21 % on (assumption): only a sticking cube, compressed further in places, feels it.
""".splitlines()


@dataclass(frozen=True)
class CubeForces:
    """One entry of Table I.

    Attributes:
        model, name: material model, fat or gland.
        tissue: law and sources.
        compression: share of the height.
        paper_n: what the paper prints, N; None where it prints nothing.
        bulk_kpa: bulk modulus of the finite elements.
        stiffer_n: what twice that modulus adds to the force, N.
        law_n: force by the law, N.
        elements_n: by route, then by elements a side, N; None where no equilibrium was found.
    """

    model: str
    name: str
    tissue: CatalogueTissue
    compression: float
    paper_n: float | None
    bulk_kpa: float
    stiffer_n: float | None
    law_n: float
    elements_n: Mapping[str, Mapping[int, float | None]]


def as_files(found: Sequence[CubeForces], rows: Sequence[Mapping[str, Any]]) -> dict[str, bytes]:
    """The table's three forms by name; `rows` have the columns of the CSV."""
    first = _first(found)
    sections = [
        _law_section(found),
        _mesh_section("By finite elements, sliding faces", found, "fe_sliding"),
        _mesh_section("By finite elements, sticking faces", found, "fe_sticking"),
        _constants(found),
        Section("Notes", ("what to know",), [[note] for note in _NOTES]),
    ]
    return {
        f"tables/{NAME}.csv": as_csv(COLUMNS, [[_text(row[c], _DECIMALS.get(c)) for c in COLUMNS] for row in rows]),
        f"tables/{NAME}.md": as_markdown(TITLE, first, sections),
        f"tables/{NAME}.html": as_html(TITLE, first, sections),
    }


def _first(found: Sequence[CubeForces]) -> list[str]:
    """What must be said first: entries that prove nothing, and cubes without an equilibrium."""
    derived = [f"{f.model} {f.name}" for f in found if f.paper_n is not None and not f.tissue.independent]
    lines = [f"These agree by construction, for their constants were derived from Table I: {', '.join(derived)}."]
    missing = [
        f"{f.model} {f.name}, {route}, {n} elements a side: no equilibrium found."
        for f in found
        for route, by_mesh in f.elements_n.items()
        for n, force in by_mesh.items()
        if force is None
    ]
    return lines + missing


def _law_section(found: Sequence[CubeForces]) -> Section:
    columns = ("model", "tissue", "compression", "law, N", "paper, N", "same rounded", "independent")
    rows = [
        [
            *(f.model, f.name, f"{f.compression:.0%}", f"{f.law_n:.3f}", _text(f.paper_n, 0)),
            "" if f.paper_n is None else _text(round(f.law_n) == f.paper_n, None),
            "" if f.paper_n is None else _text(f.tissue.independent, None),
            *(f"{f.bulk_kpa:.0f}", f"{f.bulk_kpa / f.tissue.law.mu_kpa:.0f}"),
            "" if f.stiffer_n is None else f"{100.0 * f.stiffer_n / f.law_n:.3f}",
        ]
        for f in found
    ]
    return Section("By the law, and bulk moduli", (*columns, "K, kPa", "K / mu", "2 K adds, %"), rows)


def _mesh_section(heading: str, found: Sequence[CubeForces], route: str) -> Section:
    meshes = found[0].elements_n[route]
    columns = ["model", "tissue", "law, N", *(f"{n} a side{what}" for n in meshes for what in (", N", ", % off"))]
    rows = []
    for f in found:
        cells = [f.model, f.name, f"{f.law_n:.3f}"]
        for force in f.elements_n[route].values():
            cells += ["", ""] if force is None else [f"{force:.3f}", f"{100.0 * (force / f.law_n - 1.0):+.2f}"]
        rows.append(cells)
    return Section(heading, columns, rows)


def _constants(found: Sequence[CubeForces]) -> Section:
    rows = []
    for f in found:
        for name, source in f.tissue.sources.items():
            value: Any = f.tissue.law
            for part in name.split("."):
                value = getattr(value, part)
            rows.append([f.model, f.name, name, f"{value:g}", source.provenance, source.note])
    return Section("Constants", ("model", "tissue", "constant", "value", "provenance", "note"), rows)


def _text(value: Any, decimals: int | None) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if decimals is None else f"{value:.{decimals}f}"
