"""Stage `report`: one page for the whole cohort, which opens from disk in any browser."""

from pathlib import Path

from stages.cohort.cases import read_cohort
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Inputs, NoSettings, Stage, Subject
from stages.engine.registry import CASE_STAGES, VIEW_STAGES
from stages.formats.pages import is_number
from stages.report.case import case_page
from stages.report.cohort import cards, errors_picture, excluded_rows, findings_section, statistics_sections
from stages.report.provenance import methods_paragraph, settings_section, versions_section
from stages.tables.record import TABLES, TablesRecord

TEMPLATES = Path(__file__).parent / "templates"
_ORDER = ("segment", "mesh", *VIEW_STAGES, "localize", "evaluate", "figures")


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Write the page from all artefacts, those of failed cases too."""
    artefacts = [artefact for name in _ORDER for artefact in inputs.artefacts(name)]
    cohort = read_cohort(inputs.files["cases"], inputs.path("views"))
    pages = [
        case_page(name, row.laterality, [a for a in artefacts if a.case == name]) for name, row in cohort.cases.items()
    ]
    tables = TablesRecord(inputs.artefact("tables"))
    statistics = tables.statistics
    done = sum(page.status == "ok" for page in pages)
    html = _render(
        cards=cards(statistics, done, len(pages)),
        pages=pages,
        excluded=excluded_rows(cohort),
        errors=errors_picture(artefacts, statistics),
        statistics=statistics_sections(statistics),
        findings=findings_section(tables.findings),
        tables=[(table.title, f"tables/{table.name}") for table in TABLES],
        methods=methods_paragraph(artefacts),
        settings=settings_section(_with_settings(inputs, artefacts)),
        versions=versions_section(_with_settings(inputs, artefacts)),
    )
    return Fields(files={"report.html": html.encode()}, values={"cases": len(pages), "complete": done})


def _with_settings(inputs: Inputs, artefacts: list[Artefact]) -> list[Artefact]:
    return [*inputs.artefacts("calibrate"), *artefacts]


def _render(**content: object) -> str:
    # Only this function pays for jinja2.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests["a_number"] = is_number
    return environment.get_template("report.html.j2").render(**content)


STAGE = Stage(
    name="report",
    schema=1,
    inputs=("cases", "tables"),
    optional=("views", "calibrate", *CASE_STAGES, *VIEW_STAGES),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    folder=".",
)
