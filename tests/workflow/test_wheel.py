"""The wheel: the workflow travels in it, and runs from it in a folder where no checkout is."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.workflow.toy_project import PROJECT, make_cohort, make_project

BUILD = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"
WORKFLOW = ("Snakefile", "workflow", "profiles", "config")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The unpacked wheel of the toy project."""
    folder = tmp_path_factory.mktemp("wheel")
    project = make_project(folder / "project")
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(PROJECT / name, project / name)
    subprocess.run([sys.executable, "-c", BUILD, str(folder / "dist")], cwd=project, check=True, capture_output=True)
    shutil.rmtree(project)
    (wheel,) = (folder / "dist").glob("mammoreg-*.whl")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


def test_workflow_travels_in_the_wheel(installed):
    home = installed / "stages/command/home"
    for name in WORKFLOW:
        source = PROJECT / name
        for path in source.rglob("*") if source.is_dir() else [source]:
            if path.is_file() and "__pycache__" not in path.parts:
                assert (home / path.relative_to(PROJECT)).is_file(), path
    (entry,) = installed.glob("mammoreg-*.dist-info/entry_points.txt")
    assert "mammoreg = stages.command.main:main" in entry.read_text()
    assert (installed / "snakemake_logger_plugin_mammoreg/__init__.py").is_file()


def test_workflow_runs_from_the_wheel(installed, tmp_path):
    make_cohort(tmp_path / "data", ("a",))
    environment = os.environ | {"PYTHONPATH": str(installed), "PYTHONDONTWRITEBYTECODE": "1"}
    words = ["run", "data/cases.tsv", "--results", "out", "--target", "a/segment", "--cores", "1"]
    before = sorted(installed.rglob("*"))
    done = subprocess.run(
        [sys.executable, "-m", "mammoreg", *words], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out/a/segment.h5").is_file()
    assert sorted(installed.rglob("*")) == before
    first = (tmp_path / "out/logs/a/segment.log").read_text().splitlines()[0]
    assert first.startswith(f"cd {tmp_path}/out && {Path(sys.executable)} -m stages run segment ")
