# The checked configuration, the cohort, and where files lie.
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.settings.types import ExecMode

from stages.cohort.cases import read_cohort
from stages.engine.config import read_config, stage_settings
from stages.engine.errors import FaultsError, UserError
from stages.cohort.preflight import check_cohort
from stages.cohort.tracked import is_indirect, tracked_files
from stages.engine.registry import (
    CASE_STAGES,
    COHORT_STAGES,
    STAGE_MODULES,
    STUDIES,
    VIEW_STAGES,
    load_stage,
    stage_digest,
)
from stages.tables.record import CSV_FILES
from stages.views import IMAGED, SECOND_VOLUME

PROJECT = Path(workflow.basedir)


def checked(function, *arguments):
    """The function's result; a user's mistake ends Snakemake with its message alone."""
    try:
        return function(*arguments)
    except UserError as error:
        raise WorkflowError(str(error)) from None


CONFIG = checked(read_config, config)
RESULTS = Path(CONFIG.results)
if set("{}") & set(str(RESULTS)):
    raise WorkflowError(
        f"results: {RESULTS}: braces are patterns to Snakemake; name a folder without them"
    )
# Where the embedded cohort's files are made; a user's tables say for themselves where theirs lie.
DIGITAL = RESULTS / "digital" if CONFIG.cases is None else None
COHORT = checked(read_cohort, *CONFIG.table_files(PROJECT), DIGITAL)
config["case_count"] = len(COHORT.cases)
# Links to files whose names Snakemake would take for patterns.
LINKS = RESULTS / ".links"
TABLES = {
    name: path
    for name, path in (("cases", COHORT.cases_file), ("views", COHORT.views_file))
    if path
}


wildcard_constraints:
    case="[A-Za-z0-9_-]+",
    view="|".join((*IMAGED, SECOND_VOLUME)),


def made_files():
    """Files of the tables that rule `digital` makes, by case; none unless the embedded cohort runs."""
    if DIGITAL is None:
        return {}
    rows = (*COHORT.cases.values(), *COHORT.mammograms.values())
    found = {case: set() for case in COHORT.cases}
    for row in rows:
        found[row.case].update(row.files().values())
    return {case: sorted(files) for case, files in found.items()}


MADE = made_files()
if workflow.exec_mode == ExecMode.DEFAULT:
    faults = check_cohort(COHORT, {file for files in MADE.values() for file in files})
    if faults:
        raise WorkflowError(str(FaultsError(faults)))


def scope(stage):
    """Whether a stage runs per case, per view or once per cohort."""
    if stage in VIEW_STAGES:
        return "view"
    return "cohort" if stage in COHORT_STAGES else STUDIES.get(stage, "case")


def named(stage, folder="", suffix=".h5"):
    """Pattern of a stage's artefact, or of its log or benchmark in the folder of that name."""
    pattern = {
        "view": f"{{case}}/{stage}.{{view}}",
        "case": f"{{case}}/{stage}",
        "cohort": stage,
    }
    return str(RESULTS / folder / f"{pattern[scope(stage)]}{suffix}")


def log_of(stage):
    return named(stage, "logs", ".log")


def benchmark_of(stage):
    return named(stage, "benchmarks", ".tsv")


def case_row(case):
    if case not in COHORT.cases:
        raise WorkflowError(
            f"no case {case!r} in {COHORT.cases_file}; its cases are {', '.join(COHORT.cases)}"
        )
    return COHORT.cases[case]


def artefacts_of(stage, case=None, view=None):
    """Artefacts of a stage: of one view, of all views of a case, or of all cases."""
    everyone = volunteers() if stage == "volunteer" else COHORT.cases
    cases = everyone if case is None else [case]
    if scope(stage) == "cohort":
        return [named(stage)]
    if scope(stage) == "case":
        return [named(stage).format(case=c) for c in cases]
    views = {c: COHORT.views(c) if view is None else [view] for c in cases}
    return [named(stage).format(case=c, view=v) for c in cases for v in views[c]]


def files_of(case, view=None):
    """Files and folders of the tables that a case, or one of its views, names, by input."""
    files = dict(case_row(case).files())
    for (owner, name), row in COHORT.mammograms.items():
        if owner == case:
            files |= {
                f"{column}_{name}" if view is None else column: p
                for column, p in row.files().items()
                if view in (None, name)
            }
    return files


def tracked(path):
    """Names under which Snakemake follows a file, or the files of a user's folder."""
    return tracked_files(path, LINKS)


def inputs_of(stage):
    """Input function of a stage: what its record declares and the cohort has."""
    record = load_stage(stage)

    def inputs(wildcards):
        case, view = wildcards.get("case"), wildcards.get("view")
        made = MADE.get(case, ())
        files = {
            name: str(path) if path in made else tracked(path)
            for name, path in (files_of(case, view) if case else TABLES).items()
        }
        found = {}
        for name in (*record.inputs, *record.optional):
            if name in STAGE_MODULES:
                found[name] = artefacts_of(name, case, view)
            elif name in files:
                found[name] = files[name]
        return {name: paths for name, paths in found.items() if paths}

    return inputs


def sources_of(stage):
    """Function of a stage's inputs that are followed under other names: their own names, by input."""
    record = load_stage(stage)

    def sources(wildcards):
        case, view = wildcards.get("case"), wildcards.get("view")
        files = files_of(case, view) if case else TABLES
        return {
            name: str(path)
            for name, path in files.items()
            if name in (*record.inputs, *record.optional)
            and path not in MADE.get(case, ())
            and is_indirect(path)
        }

    return sources


def subject_of(wildcards):
    """Side, view and values of the tables' rows, as the stage gets them."""
    case, view = wildcards.get("case"), wildcards.get("view")
    if case is None:
        return {"case": "cohort"}
    row = case_row(case)
    mammogram = COHORT.mammograms.get((case, view))
    values = row.values() | (mammogram.values() if mammogram else {})
    if view is None:
        values |= picture_values(case)
    return {"case": case, "laterality": row.laterality, "view": view, "row": values}


def picture_values(case):
    """What the table says of how to read the mammograms of a case, by column and view."""
    return {
        f"{column}_{view}": text
        for (owner, view), row in COHORT.mammograms.items()
        if owner == case
        for column, text in row.values().items()
        if column in ("pixel_spacing_mm", "orientation")
    }


def settings_of(stage):
    return stage_settings(CONFIG, stage)


def volunteers():
    """Cases with landmarks in two MR volumes."""
    known = ("mr_compressed", "mr_landmarks", "mr_compressed_landmarks")
    return [
        case
        for case, row in COHORT.cases.items()
        if not set(known) - row.files().keys()
    ]


def stability_mesh():
    """The mesh of the scan that the key `stability_scan` names; none without it."""
    if CONFIG.stability_scan is None:
        return {}
    return {"stability_scan_mesh": [named("stability_scan_mesh", "stability")]}


def complete_file():
    return str(RESULTS / "tables" / "complete.txt")


# The stability study shares out its scenarios by rules of its own.
PLAIN_STUDIES = [name for name in STUDIES if not name.startswith("stability")]

# By stage: memory in MB that its job asks for at least, and minutes.
NEEDS = {
    "segment": (900, 5),
    "mesh": (700, 5),
    "pose": (1200, 10),
    "compress": (1200, 10),
    "shape": (900, 5),
    "solve": (1200, 10),
    "project": (1200, 10),
    "localize": (1000, 10),
    "evaluate": (1000, 10),
    "figures": (1200, 10),
    "calibrate": (700, 5),
    "tables": (1000, 10),
    "report": (1000, 10),
    "runtime": (1500, 60),
    "error_vs_runtime": (1000, 10),
    "table_1": (700, 20),
    "volunteer": (1200, 30),
    "paper_tables": (700, 10),
    "stability_scan_mesh": (1500, 10),
    "stability_batch": (1500, 120),
    "stability": (1000, 10),
}


# A patient's folder holds many times what is read of it.
MOST_MB = 8000


def memory_of(stage):
    """Resource function: more where files are large, and with each attempt."""
    least, _ = NEEDS[stage]

    def memory(wildcards, input, attempt):
        return max(least, min(400 + 12 * int(input.size_mb), MOST_MB)) * attempt

    return memory


def minutes_of(stage):
    return NEEDS[stage][1]


def message_of(stage):
    subject = {
        "view": "{wildcards.case} {wildcards.view}",
        "case": "{wildcards.case}",
        "cohort": "cohort",
    }
    return f"{subject[scope(stage)]}: {stage}"


def beside(stage):
    """Files that a stage leaves beside its artefact and that a user asks for by name."""
    tables = {
        "tables": ("cohort.nc", *CSV_FILES),
        "error_vs_runtime": ("error_vs_runtime.csv",),
        "table_1": [f"table_1_forces.{form}" for form in ("csv", "md", "html")],
        "paper_tables": (
            "table_2_materials.csv",
            "table_3_boundary.csv",
            "table_4_skin.csv",
            "findings_tables_2_to_4.csv",
        ),
        "stability": ("stability.csv",),
    }
    pages = [str(RESULTS / "report.html")] if stage == "report" else []
    return pages + [str(RESULTS / "tables" / name) for name in tables.get(stage, ())]
