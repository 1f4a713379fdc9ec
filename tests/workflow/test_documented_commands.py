"""Every command line of the documentation is one that works, as it is written."""

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

from stages.command.main import main
from stages.engine.artefact import Fields, write_artefact
from tests.stages.cohort_files import write_cohort
from tests.stages.mr_series import series, write
from tests.stages.test_command_line import ATTRS
from tests.stages.test_import import write_views
from tests.workflow.toy_project import PROJECT, make_project

DOCUMENTS = ("README.md", "config/README.md", "config/digital/README.md", "docs/real_patients.md", "CONTRIBUTING.md")
PROGRAMS = ("mammoreg", "snakemake", "python", "make", "pip", "source")
# A block of another language is no block of commands.
_BLOCK = re.compile(r"^```(?:sh|bash|console)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_ANY_BLOCK = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"`([^`\n]+)`")


def commands(text: str) -> Iterator[str]:
    """Lines of the text's blocks without their comments, and what stands in backquotes and begins with a program."""
    for block in _BLOCK.findall(text):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words:
                yield shlex.join(words)
    for span in _SPAN.findall(_ANY_BLOCK.sub("", text)):
        if span.split()[0].removeprefix(".venv/bin/") in PROGRAMS and len(span.split()) > 1:
            yield shlex.join(shlex.split(span))


def documented() -> list[tuple[str, str]]:
    found = [(line, name) for name in DOCUMENTS for line in commands((PROJECT / name).read_text())]
    return list({line: (line, name) for line, name in found}.values())


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A checkout of toy stages with a user's files in it: what the documents' commands name."""
    folder = make_project(tmp_path_factory.mktemp("desk") / "checkout")
    for name in ("Makefile", "pyproject.toml", "requirements.lock", "requirements-dev.lock"):
        shutil.copy(PROJECT / name, folder / name)
    for place in (folder, folder / "my"):
        place.mkdir(exist_ok=True)
        write_cohort(place)
        shutil.copy(place / "mr_lesion.nii.gz", place / "lesion.nii.gz")
        for table in ("cases.tsv", "views.tsv"):
            path = place / table
            path.write_text(path.read_text().replace("\nc1\t", "\ncase1\t"))
    _hospital_folders(folder)
    (folder / "my/config.yaml").write_text("mesh: {elements: 5}\n")
    for results in ("my_results", "my/results"):
        (folder / results / ".snakemake").mkdir(parents=True)
        for stage in ("localize", "pose.CC", "mesh"):
            write_artefact(folder / results / f"case1/{stage}.h5", ATTRS, Fields(values={"rows": [{"x": 1.0}]}))
    return folder


def _hospital_folders(folder):
    """What `docs/real_patients.md` begins with: a PACS export, a public data set, and what import makes of them."""
    shutil.copytree(PROJECT / "examples", folder / "examples")
    for export, cohort in (("export", "my_cohort"), ("dataset-uta11-dicom/dataset", "uta11")):
        write(folder / export / "MR", series("t1", count=12))
        write_views(folder / export / "MG", "Doe^Jane", "RCC", "RMLO")
        with contextlib.redirect_stdout(None):
            assert main(["import", str(folder / export), str(folder / cohort), "--with-paths"]) == 0
    (folder / "dataset-uta11-findings").mkdir()


def variant(words: list[str]) -> list[str]:
    """The same command, or where it takes long one that finds out the same without doing it."""
    program, rest = words[0].removeprefix(".venv/bin/"), words[1:]
    if program == "mammoreg":
        if rest[0] == "import":  # the desk has what comes out of it already
            rest = [rest[0], rest[1], f"{rest[2]}_anew", *rest[3:]]
        quick = ["--dry-run"] if rest[0] in ("run", "case") and "--unlock" not in rest else []
        return [sys.executable, "-m", "mammoreg", *rest, *quick]
    if program == "snakemake":
        return [sys.executable, "-m", "snakemake", *rest, "--dry-run"]
    if program == "python":
        return [sys.executable, *rest]
    if program == "make":
        return ["make", "--dry-run", *rest]
    raise AssertionError(f"{shlex.join(words)}: say here how it is tried")


@pytest.mark.parametrize(("line", "document"), documented())
def test_command_works_as_written(line, document, desk):
    words = shlex.split(line)
    if words[0] == "source":
        assert ".venv/bin/activate" in words[1]
        assert "-m venv .venv" in (PROJECT / "Makefile").read_text()
        return
    if words[0] == "pip":
        assert words[1:] == ["install", "."], "what the test of the wheel shows"
        return
    assert "..." not in words, "a line to be filled in is none to be pasted"
    environment = os.environ | {"PYTHONPATH": str(desk / "src")}
    done = subprocess.run(
        variant(words), cwd=desk, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert done.returncode == 0, f"{document}: {line}\n{done.stdout}"
    assert "Traceback" not in done.stdout


def test_every_document_has_commands_and_none_is_missed():
    found = documented()
    assert {name for _, name in found} >= {"README.md", "config/README.md", "CONTRIBUTING.md"}
    programs = {shlex.split(line)[0].removeprefix(".venv/bin/") for line, _ in found}
    assert {"mammoreg", "snakemake", "make"} <= programs <= {*PROGRAMS}
    text = "```\nmammoreg run a.tsv  # text\n```\nand `snakemake table_1`, `mesh`\n```python\nx = 1\n```\n"
    assert list(commands(text)) == ["mammoreg run a.tsv", "snakemake table_1"]
