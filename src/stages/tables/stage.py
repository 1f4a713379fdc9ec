"""Stage `tables`: the cohort's tables, from what `localize` and `evaluate` left of each case."""

from collections.abc import Mapping, Sequence

from stages.engine.artefact import Artefact, Fields
from stages.engine.completion import first_failures
from stages.engine.contract import Failure, Inputs, NoSettings, Stage, Subject
from stages.formats.findings import FINDINGS
from stages.formats.pages import Section, as_csv, as_html, as_markdown, cells, section_of
from stages.formats.table import Row, Table
from stages.tables.findings import cohort_findings
from stages.tables.record import FAILURES, LANDMARKS, TABLE_5, TABLE_6, TABLES, tables_fields
from stages.tables.statistics import Group, groups, incomplete, readable_rows, statistics_rows

_INPUTS = ("segment", "mesh", "pose", "compress", "shape", "solve", "project", "localize", "evaluate", "figures")


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Write every table, with or without truth; cases that failed are named first."""
    from stages.tables.netcdf import (
        cohort_netcdf,
    )  # not for those who only want this stage's settings: xarray is slow to import

    artefacts = [artefact for name in _INPUTS for artefact in inputs.artefacts(name)]
    rows_of = {table.name: table.rows(artefacts) for table in TABLES}
    found = groups(*(rows_of[table.name] for table in (TABLE_5, TABLE_6, LANDMARKS)))
    failures = first_failures(artefacts)
    files: dict[str, bytes] = {"cohort.nc": cohort_netcdf(rows_of, _outcomes(artefacts, failures))}
    for table in TABLES:
        files |= _files(table, rows_of[table.name], [g for g in found if g.table == table.name], _texts(failures))
    statistics = [row for group in found for row in statistics_rows(group)]
    findings = cohort_findings(found)
    overview = section_of("", statistics)
    files["summary.csv"] = as_csv(overview.columns, overview.rows)
    files["findings.csv"] = as_csv(FINDINGS, findings)
    files["failures.csv"] = as_csv(FAILURES, [[case, f.view, f.stage, f.status, f.message] for case, f in failures])
    return tables_fields(files, statistics, findings, _texts(failures))


def _texts(failures: Sequence[tuple[str, Failure]]) -> list[str]:
    return [f"{case}{f' {each.view}' if each.view else ''} {each.status}: {each}" for case, each in failures]


def _outcomes(artefacts: Sequence[Artefact], failures: Sequence[tuple[str, Failure]]) -> dict[str, tuple[str, str]]:
    """Status and message of every case, those of its first failure."""
    outcomes = {artefact.case: ("ok", "") for artefact in artefacts}
    return outcomes | {case: (failure.status, str(failure)) for case, failure in reversed(failures)}


def _files(table: Table, rows: Sequence[Row], found: Sequence[Group], failures: Sequence[str]) -> Mapping[str, bytes]:
    """One table in its three forms; statistics come before the rows, and what is missing before all."""
    first, sections = list(failures), []
    for group in found:
        statistics = statistics_rows(group)
        first += incomplete(statistics)
        sections.append(section_of(f"Statistics: {group.label}", readable_rows(statistics)))
    text = cells(table, rows)
    sections.append(Section("Measurements", table.columns, text))
    return {
        f"{table.name}.csv": as_csv(table.columns, text),
        f"{table.name}.md": as_markdown(table.title, first, sections),
        f"{table.name}.html": as_html(table.title, first, sections),
    }


STAGE = Stage(name="tables", schema=1, inputs=(), optional=_INPUTS, settings=NoSettings, run=run, takes_failed=True)
