"""Tables II to IV of the cohort's volunteers beside the paper's, from the cases' `volunteer`."""

from collections.abc import Mapping, Sequence
from typing import Any

from mammoreg.metrics.findings import Finding, judged, numbers_of
from mammoreg.metrics.summary import Summary, summarise
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Inputs, NoSettings, Stage, Subject
from stages.formats.findings import FINDINGS, findings_rows
from stages.formats.pages import Section, as_csv, as_html, as_markdown, cells, section_of
from stages.formats.table import Row, Table
from stages.studies.volunteer.paper_sentences import CLAIMS, PAPER, sentences
from stages.studies.volunteer.record import VolunteerRecord
from stages.studies.volunteer.stage import REFERENCES

STUDY = "volunteer"
FINDINGS_FILE = "findings_tables_2_to_4.csv"
LATERAL = " lateral"
TABLES = (
    Table(
        "table_2_materials",
        "Table II: landmarks with different materials",
        STUDY,
        "table_2_rows",
        ("model", "landmark"),
        {"distance_mm": 2},
    ),
    Table(
        "table_3_boundary",
        "Table III: landmarks with different boundary conditions",
        STUDY,
        "table_3_rows",
        ("boundary", "landmark"),
        {"distance_mm": 2},
    ),
    Table(
        "table_4_skin",
        "Table IV: landmarks with different skins",
        STUDY,
        "table_4_rows",
        ("skin", "landmark"),
        {"distance_mm": 2, "lateral_mm": 2},
    ),
)
REPORT = {
    "force_n": ("force, N", 1),
    "iterations": ("Newton iterations", 0),
    "load_steps": ("load steps", 0),
    "min_det_f": ("smallest det F", 2),
    "volume_change": ("volume change", 4),
    "moved_mm": ("landmarks moved, mm", 2),
    "points": ("points of the skin tied", 0),
    "points_left_mm": ("points' distance left, mm", 2),
    "lateral_mm": ("lateral elongation, mm", 1),
    "true_lateral_mm": ("true, mm", 1),
    "antero_posterior_mm": ("antero-posterior elongation, mm", 1),
    "true_antero_posterior_mm": ("true, mm ", 1),
}
_OWN = "the run's own mechanics"
_PLAIN = "the run's mechanics but for the tissue, which is the paper's: homogeneous and without fibres unless varied"
_SMOOTH = f"{_PLAIN}, between smooth plates, for a sliding skin lets no friction through to the tissue"
_SETTING = {"table_2": ("plain", _PLAIN), "table_3": ("own", _OWN), "table_4": ("smooth", _SMOOTH)}


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Write each table as CSV, and a page beside the paper's numbers."""
    volunteers = inputs.artefacts(STUDY)
    files: dict[str, bytes] = {}
    said: dict[str, Any] = {}
    findings: list[list[str]] = []
    for table in TABLES:
        rows = table.rows(volunteers)
        cases = {a.case: a for a in volunteers if any(row["case"] == a.case for row in rows)}
        parts = [_case_sections(table, artefact) for artefact in cases.values()]
        first = [text for a in cases.values() for text in _missing(table, a)]
        first = first or ([] if cases else ["no case of this cohort has landmarks in two MR volumes"])
        text = cells(table, rows)
        sections = [*(s for part in parts for s in part), Section("Measurements", table.columns, text)]
        files |= {
            f"tables/{table.name}.csv": as_csv(table.columns, text),
            f"tables/{table.name}.md": as_markdown(table.title, first, sections),
            f"tables/{table.name}.html": as_html(table.title, first, sections),
        }
        said[table.name] = {a.case: _said(table, a) for a in cases.values()}
        findings += [row for a in cases.values() for row in findings_rows(table.name, a.case, _findings(table, a))]
    files[f"tables/{FINDINGS_FILE}"] = as_csv(FINDINGS, findings)
    return Fields(files=files, values={"sentences": said})


def _key(table: Table) -> str:
    """`table_2` of `table_2_materials`."""
    return "_".join(table.name.split("_")[:2])


def _summaries(table: Table, artefact: Artefact) -> dict[str, Summary]:
    """Statistics of a volunteer by variation; of the lateral part under the name with `lateral` behind it."""
    rows: Sequence[Row] = artefact.value(table.value)
    found = {}
    for name in dict.fromkeys(row[table.keys[0]] for row in rows):
        mine = [row for row in rows if row[table.keys[0]] == name]
        found[name] = summarise([row["distance_mm"] for row in mine])
        if "lateral_mm" in table.numbers:
            found[name + LATERAL] = summarise([row["lateral_mm"] for row in mine])
    return found


def _findings(table: Table, artefact: Artefact) -> list[Finding]:
    here, paper = _summaries(table, artefact), PAPER[_key(table)]
    return judged(CLAIMS[_key(table)], numbers_of(paper), numbers_of(here))


def _said(table: Table, artefact: Artefact) -> list[str]:
    return sentences(_findings(table, artefact))


def _missing(table: Table, artefact: Artefact) -> list[str]:
    """What a table says first: variations without result, and why."""
    runs = _runs(table, artefact)
    return [f"{artefact.case}, {run['name']}: {run['message']}" for run in runs if run["message"]]


def _runs(table: Table, artefact: Artefact) -> list[Mapping[str, Any]]:
    return VolunteerRecord(artefact).runs(_key(table))


def _case_sections(table: Table, artefact: Artefact) -> list[Section]:
    """A volunteer's statistics beside the paper's with the sentences, and the report of the solves."""
    here, paper = _summaries(table, artefact), PAPER[_key(table)]
    names = [name for name in here if not name.endswith(LATERAL)]
    rows = [{table.keys[0]: name, **_words(here, name, ""), **_words(paper, name, "paper: ")} for name in names]
    statistics = section_of(f"{artefact.case}: distances in mm", rows)
    return [
        Section(
            statistics.heading,
            statistics.columns,
            statistics.rows,
            [*_said(table, artefact), _setting(table, artefact)],
        ),
        _report(table, artefact),
    ]


def _words(found: Mapping[str, Summary], name: str, prefix: str) -> dict[str, str]:
    """Mean (SD) and maximum of a variation, of the paper's without the count; the lateral part where a table has it."""
    words = {} if prefix or name not in found else {"n of N": f"{found[name].n} of {found[name].of}"}
    words |= _numbers(found.get(name), prefix)
    if any(other.endswith(LATERAL) for other in found):
        words |= _numbers(found.get(name + LATERAL), f"{prefix}lateral ")
    return words


def _numbers(summary: Summary | None, prefix: str) -> dict[str, str]:
    mean = largest = ""
    if summary is not None and summary.mean_mm is not None:
        sd = "" if summary.sd_mm is None else f" ({summary.sd_mm:.1f})"
        mean, largest = f"{summary.mean_mm:.1f}{sd}", f"{summary.max_mm:.1f}"
    return {f"{prefix}mean (SD)": mean, f"{prefix}maximum": largest}


def _setting(table: Table, artefact: Artefact) -> str:
    """What the table starts from, in words and settings."""
    which, words = _SETTING[_key(table)]
    keys = VolunteerRecord(artefact).mechanics(which)
    if keys is None:
        return f"Setting: {words}."
    return f"Setting: {words}: {', '.join(f'{key} {value}' for key, value in keys.items())}."


def _report(table: Table, artefact: Artefact) -> Section:
    """Force, iterations and elongations of every variation; columns that are empty throughout are left out."""
    runs = _runs(table, artefact)
    used = [name for name in REPORT if any(run.get(name) is not None for run in runs)]
    rows = [[run["name"], *(_number(run.get(name), REPORT[name][1]) for name in used)] for run in runs]
    note = f"Landmarks moved: mean distance from where {REFERENCES[_key(table)]} puts them.{_furthest(runs)}"
    return Section(
        f"{artefact.case}: solves", [table.keys[0], *(REPORT[name][0].strip() for name in used)], rows, [note]
    )


def _furthest(runs: Sequence[Mapping[str, Any]]) -> str:
    """Which variation matters most."""
    moved = {run["name"]: run["moved_mm"] for run in runs if run.get("moved_mm") is not None}
    if not moved:
        return ""
    name = max(moved, key=lambda each: moved[each])
    return f" {name.replace('_', ' ').capitalize()} moves them furthest, by {moved[name]:.2f} mm."


def _number(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"


STAGE = Stage(
    name="paper_tables",
    schema=1,
    inputs=(),
    optional=(STUDY,),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    folder=".",
)
