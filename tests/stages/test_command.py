"""The command `mammoreg`: what it makes of its options, its words, its exit status; no workflow runs here."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mammoreg.errors import DataError
from stages.cohort.cases import CaseRow, ViewRow, read_cohort
from stages.command import one_case, running
from stages.command.home import workflow_home
from stages.command.keys import key_values, path_keys_from
from stages.command.main import main, mammoreg_parser
from stages.command.progress import Progress, duration
from stages.command.snakemake_words import is_chatter, killed_by, lock_message, plain
from stages.command.summary import summary
from stages.engine.errors import UserError
from stages.engine.outcome import BUG, CASES_FAILED, MISTAKE, VARIABLE, note_outcome, worst_outcome

PROJECT = Path(__file__).resolve().parents[2]
COMMANDS = ("run", "case", "check", "stage", "show", "export")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_describes_every_option_and_has_an_example(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert f"example:\n  mammoreg {command} " in text
    (commands,) = [a for a in mammoreg_parser()._actions if a.choices and "run" in a.choices]
    assert [a.dest for a in commands.choices[command]._actions if not a.help] == []


def test_help_and_version(capsys):
    for arguments, part in ((["--help"], "3 some case failed"), (["--version"], "mammoreg ")):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 0
        assert part in capsys.readouterr().out


def test_usage_is_status_2(capsys):
    for arguments in (["walk"], ["export", "a.h5"], ["case", "--laterality", "R"]):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 2
    assert main([]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status", "traced"),
    [(UserError("no such thing"), 1, False), (DataError("bad data"), 1, False), (ZeroDivisionError("x"), 4, True)],
)
def test_mistake_is_a_message_and_a_bug_is_traced(error, status, traced, monkeypatch, capsys):
    def fail(given):
        raise error

    monkeypatch.setattr(running, "run_cohort", lambda *_: fail(None))
    assert main(["run", "cases.tsv"]) == status
    text = capsys.readouterr().err
    assert str(error) in text
    assert ("Traceback" in text) == traced


def test_python_m_mammoreg_is_the_command_and_needs_no_workflow_for_its_help(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "mammoreg", "show", "no.h5"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (1, "there is no file no.h5\n")


def test_workflow_is_that_of_the_checkout():
    assert workflow_home() == PROJECT


def test_keys_of_a_file_and_of_the_command_line(tmp_path):
    (tmp_path / "mine.yaml").write_text("mesh:\n  elements: 5\n  max_volume_error: 0.03\nresults: out\n")
    values = key_values(
        tmp_path / "mine.yaml", ["mesh.elements=10", "pose.use_density=false", "runtime.elements=[5, 7]"]
    )
    assert values == {
        "mesh": {"elements": 10, "max_volume_error": 0.03},
        "results": "out",
        "pose": {"use_density": False},
        "runtime": {"elements": [5, 7]},
    }
    assert path_keys_from({"cases": "a.tsv", "views": None, "mesh": 1}, Path("/data")) == {
        "cases": "/data/a.tsv",
        "views": None,
        "mesh": 1,
    }


@pytest.mark.parametrize(
    ("text", "pairs", "message"),
    [
        ("- a\n- b\n", [], "holds no keys"),
        ("a: [1\n", [], "cannot be read as YAML"),
        ("", ["mesh"], "--set mesh: is no key and value; write --set mesh.elements=10"),
        ("", [".elements=3"], "is no key and value"),
        ("mesh: 3", ["mesh.elements=3"], "mesh is a value, no section"),
    ],
)
def test_keys_that_cannot_be_read(text, pairs, message, tmp_path):
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(UserError, match=message):
        key_values(tmp_path / "mine.yaml", pairs)


def test_missing_config_file_is_named():
    with pytest.raises(UserError, match=r"--config-file no.yaml: cannot be read \(No such file"):
        key_values(Path("no.yaml"), [])


def test_targets_are_rules_or_files_below_the_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    results = tmp_path / "my results"
    for text in ("a/pose.CC.h5", "my results/a/pose.CC.h5", str(results / "a/pose.CC.h5"), "a/pose.CC"):
        assert running._target(text, results) == "a/pose.CC.h5"
    assert running._target("table_1", results) == "table_1"
    assert running._target("report.html", results) == "report.html"


def test_results_of_a_bare_snakemake_are_not_taken_for_own(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "segment.h5").touch()
    with pytest.raises(UserError, match="give another folder with --results"):
        running._check_results(tmp_path)
    (tmp_path / ".snakemake").mkdir()
    running._check_results(tmp_path)


def test_case_has_an_option_for_every_column(capsys):
    with pytest.raises(SystemExit):
        main(["case", "--help"])
    text = capsys.readouterr().out
    for column in one_case._columns(CaseRow):
        assert f"--{column.replace('_', '-')} " in text
    for column in one_case._columns(ViewRow):
        for view in ("cc", "mlo"):
            assert f"--{view} " if column == "image" else f"--{view}-{column.replace('_', '-')} " in text


def test_case_writes_the_tables_of_what_it_was_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    called = []
    monkeypatch.setattr(one_case, "run_cohort", lambda given, *rest: called.append(rest) or 0)
    words = ["case", "--case", "left1", "--mr", "a b/mr.nii.gz", "--laterality", "L", "--compression", "0.4"]
    words += ["--mlo", "mlo.png", "--mlo-pixel-spacing-mm", "0.1", "--mlo-thickness-mm", "52.5", "--results", "out"]
    assert main(words) == 0
    results = tmp_path / "out"
    assert called == [(results / "cases.tsv", results / "views.tsv", [])]
    cohort = read_cohort(results / "cases.tsv", results / "views.tsv")
    case, view = cohort.cases["left1"], cohort.mammograms["left1", "MLO"]
    assert (case.laterality, case.mr, case.compression) == ("L", tmp_path / "a b/mr.nii.gz", 0.4)
    assert (view.image, view.pixel_spacing_mm, view.thickness_mm) == (tmp_path / "mlo.png", 0.1, 52.5)
    assert main(words) == 0, "the same case again"


def test_case_leaves_tables_of_others_alone(tmp_path, capsys):
    (tmp_path / "cases.tsv").write_text("case\tlaterality\tmr\na\tL\ta.nii\nb\tL\tb.nii\n")
    before = (tmp_path / "cases.tsv").read_bytes()
    assert main(["case", "--mr", "mr.nii", "--laterality", "L", "--results", str(tmp_path)]) == 1
    assert "is there already, with a, b; give another folder with --results" in capsys.readouterr().err
    assert (tmp_path / "cases.tsv").read_bytes() == before


def test_column_of_a_view_without_its_image(tmp_path, capsys):
    words = ["case", "--mr", "m.nii", "--laterality", "L", "--cc-thickness-mm", "50", "--results", str(tmp_path)]
    assert main(words) == 1
    assert capsys.readouterr().err == "--cc-thickness-mm is given without --cc; give the mammogram as well\n"


def test_time_left_counts_work_not_jobs():
    clock = [0.0]
    progress = Progress({"mesh": 1, "pose": 2, "all": 1}, lambda: clock[0])
    assert (progress.share, progress.left) == (0.0, "")
    clock[0] = 45.0
    progress.finish("mesh")
    assert progress.share == pytest.approx(4.5 / 32.5)
    assert progress.left_s == pytest.approx(10.0 * 28.0)
    assert progress.left == "about 5 min left"
    progress.finish("pose")
    progress.finish("pose")
    progress.finish("all")
    assert (progress.share, progress.left_s) == (1.0, 0.0)


def test_durations_in_words():
    assert [duration(s) for s in (0.4, 89.0, 91.0, 5300.0, 7500.0)] == ["0 s", "89 s", "2 min", "88 min", "2 h 05 min"]


def test_exception_loses_its_name_and_its_places():
    text = (
        'WorkflowError in file "/home/me/workflow/rules/common.smk", line 33:\n2 faults found before the first job:\n'
        '  1. cases.tsv row 1: unknown column\n  File "/home/me/workflow/rules/common.smk", line 40, in <module>\n'
        '  File "/home/me/workflow/rules/common.smk", line 34, in checked'
    )
    assert plain(text) == "2 faults found before the first job:\n  1. cases.tsv row 1: unknown column"
    assert plain("WorkflowError:\nFailed to create output directory x.") == "Failed to create output directory x."
    assert plain("Nothing to be done") == "Nothing to be done"


def test_chatter_and_what_is_none():
    for text in ("", "Select jobs to execute...", "WorkflowError:\nAt least one job did not complete successfully."):
        assert is_chatter(text)
    for text in ("Nothing to be done (all requested files are present and up to date).", "MissingRuleException:\nNo x"):
        assert not is_chatter(text)


def test_what_ended_a_job():
    assert killed_by("CalledProcessError: Command 'x' died with <Signals.SIGKILL: 9>.") == "SIGKILL"
    assert killed_by("Command 'x' returned non-zero exit status 137.") == "SIGKILL"
    assert killed_by("Command 'x' returned non-zero exit status 1.") is None


def test_lock_says_what_it_means_and_the_command():
    text = lock_message("/data/out", "mammoreg run a.tsv")
    assert "another run is at work in it, or one was killed" in text
    assert "  mammoreg run a.tsv --unlock\n  mammoreg run a.tsv" in text


def test_worst_note_is_the_status(tmp_path, monkeypatch):
    notes = tmp_path / "notes"
    assert worst_outcome(notes) == MISTAKE
    monkeypatch.setenv(VARIABLE, str(notes))
    for code in (MISTAKE, CASES_FAILED):
        note_outcome(code)
    assert worst_outcome(notes) == CASES_FAILED
    note_outcome(BUG)
    assert worst_outcome(notes) == BUG
    monkeypatch.delenv(VARIABLE)
    note_outcome(BUG)  # bare snakemake: nobody asks


def _table(path, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def test_summary_names_lesions_warnings_and_places(tmp_path):
    tables = tmp_path / "tables"
    at = {
        "case": "a",
        "view": "CC",
        "method": "updated",
        "name": "lesion",
        "column": "317",
        "row": "409",
        "message": "",
    }
    hidden = at | {"view": "MLO", "column": "", "row": "", "message": "outside the imaged part"}
    landmark = at | {"name": "P1", "column": "1"}
    _table(tables / "predictions_mammogram.csv", [at, hidden, landmark, at | {"method": "rigid", "column": "306"}])
    _table(tables / "landmarks.csv", [{"case": "a", "landmark": "P1"}])
    spot = {"case": "a", "views": "CC", "method": "updated", "name": "m", "x": "1", "y": "-2", "z": "3", "message": ""}
    _table(tables / "predictions_mr.csv", [spot])
    views = [{"case": "a", "view": "CC", "method": m, "trust": t} for m, t in (("updated", "odd"), ("plate", "no"))]
    _table(tables / "views.csv", views)
    (tmp_path / "report.html").touch()
    (tmp_path / "a" / "export").mkdir(parents=True)
    assert summary(tmp_path).splitlines() == [
        "results, method updated:",
        "  a CC: lesion of the MR volume: column 317, row 409",
        "  a MLO: lesion of the MR volume: outside the imaged part",
        "  a CC: m of the mammogram: x 1, y -2, z 3 mm (LPS), depth not determined (CC alone)",
        "warnings:",
        "  a CC: odd",
        f"report:        {tmp_path}/report.html",
        f"tables:        {tmp_path}/tables",
        f"for 3D Slicer: {tmp_path}/<case>/export",
    ]


SLEEPER = """
import pathlib, signal, subprocess, sys, time
try:
    job = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    pathlib.Path(sys.argv[1]).touch()
    job.wait()
    sys.exit(7)
except KeyboardInterrupt:
    pathlib.Path(sys.argv[2]).write_text("tidied up")
    sys.exit(1)
"""


def test_ctrl_c_ends_jobs_and_lets_snakemake_tidy_up(tmp_path):
    started, tidied = tmp_path / "started", tmp_path / "tidied"
    code = (
        "import sys; from pathlib import Path; from stages.command.supervised import supervised; import os;"
        f"print(supervised([sys.executable, '-c', {SLEEPER!r}, {str(started)!r}, {str(tidied)!r}],"
        f" os.environ, Path({str(started)!r})))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        if started.exists():
            break
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert out == "(1, True)\n"
    assert tidied.read_text() == "tidied up"
    assert "Traceback" not in err
