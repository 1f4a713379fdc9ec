"""`mammoreg run` on the toy project: from another folder, against bare Snakemake, and each of its ends."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.workflow.toy_project import make_cohort, make_project, snakemake, spoil

UGLY = ("Traceback", "RuleException", "CalledProcessError", "WorkflowError", "Error in rule")


def start(project: Path, folder: Path, *words: str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": str(project / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "mammoreg", *words]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return subprocess.Popen(command, cwd=folder, env=environment, text=True, **streams)


def mammoreg(project: Path, folder: Path, *words: str) -> tuple[int, str]:
    process = start(project, folder, *words)
    text, _ = process.communicate()
    return process.returncode, text


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A cohort of one case, without mammograms to be quick, that `mammoreg` ran from a third folder."""
    folder = tmp_path_factory.mktemp("command")
    project, cohort = make_project(folder / "the project"), make_cohort(folder / "the data", ("a",))
    (folder / "desk").mkdir()
    before = names(project)
    words = ["run", "../the data/cases.tsv", "--results", "out", "--cores", "2"]
    code, text = mammoreg(project, folder / "desk", *words)
    assert code == 0, text
    return project, cohort, folder / "desk", words, text, names(project) - before


def test_run_says_what_came_out_in_few_lines(finished):
    _, _, desk, _, text, _ = finished
    lines = text.splitlines()
    assert "a: case done (ok); 1 of 1 cases" in lines
    assert any(re.fullmatch(r"\d\d % done, about .* left", line) for line in lines)
    assert f"report:        {desk}/out/report.html" in lines
    assert f"tables:        {desk}/out/tables" in lines
    assert len(lines) < 25
    assert not [word for word in UGLY if word in text]


def test_nothing_is_written_beside_the_code(finished):
    _, _, desk, _, _, written = finished
    assert written == set()
    assert names(desk) == {name for name in names(desk) if name.split("/")[0] == "out"}


def test_bare_snakemake_makes_the_same_bytes(finished):
    project, cohort, desk, _, _, _ = finished
    done = snakemake(project, "--config", f"cases={cohort}/cases.tsv", "results=bare")
    assert done.returncode == 0, done.stdout
    bare, ours = project / "bare", desk / "out"
    files = [path.relative_to(bare) for path in bare.rglob("*") if path.is_file()]
    kept = [path for path in files if path.parts[0] not in ("logs", "benchmarks")]
    assert len(kept) > 12
    for path in kept:
        assert (ours / path).read_bytes() == (bare / path).read_bytes(), path
    shutil.rmtree(bare)


def test_again_there_is_nothing_to_do_and_the_summary_stands(finished):
    project, _, desk, words, _, _ = finished
    code, text = mammoreg(project, desk, *words)
    assert code == 0
    assert "Nothing to be done" in text
    assert "report:  " in text


def test_setting_by_its_key_reruns_its_stage_and_what_follows(finished):
    project, _, desk, words, _, _ = finished
    code, text = mammoreg(project, desk, *words, "--dry-run", "--set", "mesh.level=2")
    assert code == 0
    assert "a: mesh" in text
    assert "a: figures" in text
    assert "a: segment" not in text


def test_misspelt_key_is_status_1_and_one_message(finished):
    project, _, desk, words, _, _ = finished
    code, text = mammoreg(project, desk, *words, "--set", "mash.level=2")
    assert code == 1
    assert "config, key mash: is unknown; the nearest known one is 'mesh'" in text
    assert not [word for word in UGLY if word in text]


def test_unknown_target_is_status_1_and_no_traceback(finished):
    project, _, desk, words, _, _ = finished
    code, text = mammoreg(project, desk, *words, "--target", "zz/segment")
    assert code == 1
    assert "no case 'zz' in" in text
    assert not [word for word in UGLY if word in text]


def test_lock_is_explained_and_unlocked(finished):
    project, _, desk, words, _, _ = finished
    locks = desk / "out/.snakemake/locks"
    locks.mkdir(exist_ok=True)
    for kind in ("input", "output"):
        (locks / f"0.{kind}.lock").write_text("tables.h5\n")
    code, text = mammoreg(project, desk, *words, "--force")
    assert code == 1
    assert "another run is at work in it, or one was killed" in text
    assert "--cores 2 --force --unlock\n" in text
    assert "LockException" not in text
    assert mammoreg(project, desk, *words, "--unlock")[0] == 0
    assert mammoreg(project, desk, *words)[0] == 0


def test_ctrl_c_says_how_to_go_on_and_the_same_command_does(finished, tmp_path):
    project, _, desk, words, _, _ = finished
    words = [*words[:3], str(tmp_path / "out"), "--cores", "2"]
    process = start(project, desk, *words)
    for _ in range(1200):
        # The next stage's log: Snakemake takes away what a job has written if it has not yet seen it end.
        if (tmp_path / "out/logs/a/mesh.log").exists():
            break
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    text, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "did not finish" not in text
    assert f"Stopped. What is finished is kept; the same command goes on:\n  {sys.executable} -m mammoreg run" in text
    assert not [word for word in UGLY if word in text]
    assert (tmp_path / "out/a/segment.h5").exists()
    code, text = mammoreg(project, desk, *words, "--target", "a/mesh")
    assert code == 0, text
    assert "locked" not in text
    assert "2 steps" not in text, "segment is kept"


def test_failed_case_is_status_3_and_its_tables_are_there(finished, tmp_path):
    project, _, desk, _, _, _ = finished
    cohort = make_cohort(tmp_path / "data", ("b",))
    spoil(cohort / "b.nii.gz")
    words = ["run", str(cohort / "cases.tsv"), "--results", str(tmp_path / "out")]
    code, text = mammoreg(project, desk, *words)
    assert code == 3, text
    assert "b.nii.gz: holds NaN; export the volume again" in text
    assert (tmp_path / "out/tables.h5").exists()
    assert "report:  " in text
    assert not [word for word in UGLY if word in text]


def test_bug_is_status_4_and_names_the_log(finished, tmp_path):
    project, cohort, desk, _, _, _ = finished
    module = project / "src/stages/calibrate/stage.py"
    text = module.read_text()
    module.write_text(text.replace("    values = {", "    1 / 0\n    values = {"))
    words = ["run", str(cohort / "cases.tsv"), "--results", str(tmp_path / "out"), "--target", "calibrate.h5"]
    code, said = mammoreg(project, desk, *words)
    module.write_text(text)
    assert code == 4, said
    assert "calibrate stopped by a bug: division by zero" in said
    assert f"calibrate did not finish; its log: {tmp_path}/out/logs/calibrate.log" in said
    assert "Traceback" in (tmp_path / "out/logs/calibrate.log").read_text()
    assert not [word for word in UGLY if word in said]
