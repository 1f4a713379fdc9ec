"""A copy of the project whose stages compute next to nothing, to test the workflow itself in seconds."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np
from PIL import Image

from stages.engine.contract import Stage
from stages.engine.registry import CASE_STAGES, COHORT_STAGES, STAGE_MODULES, VIEW_STAGES, load_stage

PROJECT = Path(__file__).resolve().parents[2]
STUDIES = ("runtime", "error_vs_runtime", "volunteer", "paper_tables")
TOYS = ("digital", *CASE_STAGES, *VIEW_STAGES, *COHORT_STAGES, *STUDIES)

TOY_STAGE = '''
PAPER_TABLES = ("table_2_materials", "table_3_boundary", "table_4_skin", "findings_tables_2_to_4")

import numpy as np
from pydantic import Field
from mammoreg.errors import DataError
from stages.engine.contract import Array, Fields, SettingsModel, Stage
{imports}

class Settings(SettingsModel):
    """Settings of a stage that computes next to nothing."""
    level: float = Field(1.0, ge=0, description="a number")
    elements: int = Field(7, ge=1, description="of the true mesh; the documents set it")
    use_density: bool = Field(True, description="of the true pose; the documents set it")
{mechanics}

def run(inputs, settings, subject):
    mr = inputs.path("mr")
    if mr is not None and {name!r} == "segment":
        import nibabel
        if np.isnan(np.asanyarray(nibabel.load(mr).dataobj)).any():
            raise DataError(f"{{mr}}: holds NaN; export the volume again")
    failed = [a for found in inputs.stages.values() for a in found if not a.ok]
    failure = failed[0].failure if failed and {name!r} == "evaluate" else None
    csv_files = ()
    if {name!r} == "tables":
        from stages.tables.record import CSV_FILES as csv_files
    files = {{
        "report": {{"report.html": b"report"}},
        "tables": {{name: b"table" for name in ("cohort.nc", *csv_files)}},
        "error_vs_runtime": {{"tables/error_vs_runtime.csv": b"table"}},
        "paper_tables": {{f"tables/{{n}}.csv": b"table" for n in PAPER_TABLES}},
    }}.get({name!r}, {{}})
    values = {{"level": settings.level, "n": 3}}
    arrays = {{"level": Array(np.full(3, settings.level), "1", "level")}}
    return Fields(arrays=arrays, values=values, files=files, failure=failure)

STAGE = Stage({name!r}, 1, {required!r}, Settings, run, {optional!r}, {takes_failed!r}, {folder!r})
'''


def make_project(folder: Path, real: tuple[str, ...] = ()) -> Path:
    """Copy the workflow and the stages' machinery, with toy stages in place of the numerics but for `real`."""
    folder.mkdir()
    for name in ("Snakefile", "workflow", "profiles", "config"):
        source = PROJECT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PROJECT / "src", folder / "src", ignore=ignored)
    for name in (name for name in TOYS if name not in real):
        # What it takes and what becomes of failures is the real stage's, so that the rules are tested with it.
        stage = load_stage(name)
        module = folder.joinpath("src", *STAGE_MODULES[name].split(".")).with_suffix(".py")
        module.write_text(
            TOY_STAGE.format(
                name=name,
                imports=_imports(stage),
                mechanics=_mechanics(stage),
                required=stage.inputs,
                optional=stage.optional,
                takes_failed=stage.takes_failed,
                folder=stage.folder,
            )
        )
    (folder / "config/config.yaml").write_text("results: results\n")
    return folder


def _imports(stage: Stage) -> str:
    """What a stage with the key `mechanics` imports; it takes a second, which the others are spared."""
    return "from stages.mechanics import CoarseMechanics, Mechanics" if _mechanics(stage) else ""


def _mechanics(stage: Stage) -> str:
    """The key `mechanics` of the stages that have one, with the real stage's model."""
    info = stage.settings.model_fields.get("mechanics")
    name = getattr(info.annotation, "__name__", "") if info else ""
    return f"    mechanics: {name} = {name}()" if name else ""


def make_cohort(folder: Path, cases: tuple[str, ...] = ("a", "b", "c")) -> Path:
    """Tables and small files of a cohort: each case an MR volume and a picture of CC and of MLO, of b LMO."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(1)
    case_lines = ["case\tlaterality\tmr\tmr_landmarks"]
    view_lines = ["case\tview\timage\tpixel_spacing_mm\tthickness_mm"]
    (folder / "points.tsv").write_text("name\tx\ty\tz\nP1\t1\t2\t3\n")
    for case in cases:
        volume = rng.normal(size=(10, 11, 12)).astype(np.float32)
        nibabel.save(nibabel.Nifti1Image(volume, np.diag([1.4, 1.4, 1.4, 1.0])), folder / f"{case}.nii.gz")
        case_lines.append(f"{case}\tR\t{case}.nii.gz\tpoints.tsv")
        for view in ("CC", "LMO" if case == "b" else "MLO"):
            Image.fromarray(rng.integers(0, 255, (60, 40), dtype=np.uint8)).save(folder / f"{case}_{view}.png")
            view_lines.append(f"{case}\t{view}\t{case}_{view}.png\t1\t50")
    (folder / "cases.tsv").write_text("\n".join(case_lines) + "\n")
    (folder / "views.tsv").write_text("\n".join(view_lines) + "\n")
    return folder


def spoil(volume: Path) -> None:
    """Make a NIfTI volume NaN throughout."""
    image = nibabel.load(volume)
    nibabel.save(nibabel.Nifti1Image(np.full(image.shape, np.nan, np.float32), image.affine), volume)


def snakemake(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Snakemake in a project's copy; `stdout` holds both streams."""
    environment = os.environ | {"PYTHONPATH": str(project / "src")}
    command = [sys.executable, "-m", "snakemake", *arguments]
    return subprocess.run(
        command, cwd=project, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def inject_bug(project: Path, stage: str, condition: str) -> None:
    """Let a toy stage raise an exception that it does not know where a condition on `subject` holds."""
    module = project.joinpath("src", *STAGE_MODULES[stage].split(".")).with_suffix(".py")
    start = "def run(inputs, settings, subject):\n"
    bug = f"    if {condition}:\n        raise ZeroDivisionError('/secret/Jane')\n"
    module.write_text(module.read_text().replace(start, start + bug))
