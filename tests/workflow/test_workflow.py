"""The workflow on toy stages: whole cohorts, reruns, failures, targets, lint."""

import csv
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.workflow.toy_project import PROJECT, inject_bug, make_cohort, make_project, snakemake, spoil

NOTHING = "Nothing to be done"


def _keys(cohort: Path, results: str = "my results") -> list[str]:
    return ["--config", f"cases={cohort}/cases.tsv", f"views={cohort}/views.tsv", f"results={results}"]


def _jobs(output: str) -> list[str]:
    """Names of the jobs that a dry run lists."""
    lines = output.split("Job stats:")[1].splitlines()[3:] if "Job stats:" in output else []
    names = []
    for line in lines:
        if not line.strip() or line.startswith("total"):
            break
        names.append(line.split()[0])
    return sorted(set(names) - {"all"})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A project and a cohort of two cases that ran to its end, in folders with spaces and braces in their names."""
    folder = tmp_path_factory.mktemp("workflow")
    project = make_project(folder / "the project")
    cohort = make_cohort(folder / "the {data}", ("a", "b"))
    done = snakemake(project, *_keys(cohort))
    assert done.returncode == 0, done.stdout
    return project, cohort, done


def test_whole_cohort(finished):
    project, _, done = finished
    results = project / "my results"
    assert (results / "tables" / "complete.txt").read_text() == "a\tok\nb\tok\n"
    names = {path.name for path in (results / "a").glob("*.h5")}
    assert {"segment.h5", "pose.CC.h5", "solve.MLO.h5", "localize.h5", "figures.h5"} <= names
    assert (results / "b" / "solve.LMO.h5").exists()
    assert "2 of 2 cases" in done.stdout
    assert "all cases complete" in done.stdout
    assert len(done.stdout.splitlines()) < 25, "a few lines a case, not five a job"


def test_every_job_has_log_and_benchmark(finished):
    project, _, _ = finished
    results = project / "my results"
    artefacts = {path.relative_to(results).with_suffix("") for path in results.glob("*/*.h5")}
    for kind, suffix in (("logs", ".log"), ("benchmarks", ".tsv")):
        found = {path.relative_to(results / kind).with_suffix("") for path in (results / kind).glob(f"*/*{suffix}")}
        assert artefacts <= found


def test_first_line_of_a_log_runs_the_same_stage_as_pasted(finished, tmp_path):
    project, _, _ = finished
    log, artefact = project / "my results/logs/a/compress.CC.log", project / "my results/a/compress.CC.h5"
    command = log.read_text().splitlines()[0]
    assert command.endswith("--out 'my results/a/compress.CC.h5'")
    command = command.replace("'my results/a/compress.CC.h5'", str(tmp_path / "again.h5"))
    environment = os.environ | {"PYTHONPATH": str(project / "src"), "PATH": "/usr/bin:/bin"}
    subprocess.run(command, shell=True, cwd=tmp_path, env=environment, check=True, capture_output=True)
    assert (tmp_path / "again.h5").read_bytes() == artefact.read_bytes()


def test_log_tells_what_the_stage_found(finished):
    project, _, _ = finished
    lines = (project / "my results/logs/a/compress.CC.log").read_text().splitlines()
    assert lines[1].startswith("compress: ok after ")
    assert lines[1].endswith(" s")
    assert "  level = 1" in lines[2:]


def test_second_run_has_nothing_to_do_even_after_touching_and_copying(finished):
    project, cohort, _ = finished
    assert NOTHING in snakemake(project, *_keys(cohort)).stdout
    now = time.time()
    for path in cohort.iterdir():
        path.write_bytes(path.read_bytes())
        os.utime(path, (now + 5, now + 5))
    assert NOTHING in snakemake(project, *_keys(cohort)).stdout


def test_comment_in_the_code_reruns_nothing_and_code_reruns_what_follows(finished):
    project, cohort, _ = finished
    module = project / "src/stages/shape/stage.py"
    text = module.read_text()
    module.write_text("# a comment\n" + text)
    assert NOTHING in snakemake(project, *_keys(cohort), "-n").stdout
    module.write_text(text.replace("np.full(3, settings.level)", "np.full(3, 2 * settings.level)"))
    jobs = _jobs(snakemake(project, *_keys(cohort), "-n").stdout)
    module.write_text(text)
    assert {"shape", "solve", "project", "localize"} <= set(jobs)
    assert not {"segment", "mesh", "pose", "compress", "calibrate"} & set(jobs)


def test_changed_setting_reruns_its_stage_and_what_follows(finished, tmp_path):
    project, cohort, _ = finished
    (tmp_path / "mine.yaml").write_text("compress:\n  level: 2.0\n")
    done = snakemake(project, "--configfile", str(tmp_path / "mine.yaml"), *_keys(cohort), "-n")
    jobs = _jobs(done.stdout)
    assert {"compress", "shape", "solve", "project", "localize", "evaluate", "tables"} <= set(jobs)
    assert not {"segment", "mesh", "pose", "calibrate"} & set(jobs)


@pytest.mark.parametrize(("key", "first"), [("friction", "pose"), ("gland_contrast", "compress"), ("skin", "compress")])
def test_shared_key_reruns_the_stages_for_which_it_counts(finished, tmp_path, key, first):
    project, cohort, _ = finished
    config = tmp_path / "c.yaml"
    config.write_text(f"mechanics: {{{key}: {'attached' if key == 'skin' else 0.3}}}\n")
    jobs = _jobs(snakemake(project, "-n", "--configfile", str(config), *_keys(cohort)).stdout)
    assert {"compress", "shape", "solve", "localize"} <= set(jobs)
    assert ("pose" in jobs) is (first == "pose")
    assert not {"segment", "mesh", "calibrate"} & set(jobs)


def test_thickness_of_one_view_reruns_that_view_only(finished):
    project, cohort, _ = finished
    table = cohort / "views.tsv"
    text = table.read_text()
    table.write_text(text.replace("a\tCC\ta_CC.png\t1\t50", "a\tCC\ta_CC.png\t1\t55"))
    output = snakemake(project, *_keys(cohort), "-n").stdout
    table.write_text(text)
    assert "a CC: pose" in output
    assert "a MLO: pose" not in output
    assert "b CC: pose" not in output


def test_dropping_marks_reruns_nothing_before_localize(finished):
    project, cohort, _ = finished
    table = cohort / "cases.tsv"
    text = table.read_text()
    table.write_text(text.replace("a.nii.gz\tpoints.tsv", "a.nii.gz\t"))
    output = snakemake(project, *_keys(cohort), "-n").stdout
    table.write_text(text)
    assert _jobs(output) == ["complete", "evaluate", "figures", "localize", "report", "tables"]
    assert "b: localize" not in output


def test_one_case_and_one_stage(finished):
    project, cohort, _ = finished
    one = snakemake(project, "-n", "--forceall", "my results/a/localize.h5", *_keys(cohort)).stdout
    assert "a: segment" in one
    assert "b: segment" not in one
    forced = snakemake(project, "-n", "-f", "my results/a/compress.CC.h5", *_keys(cohort)).stdout
    assert _jobs(forced) == ["compress"]


def test_number_of_cores_does_not_change_a_byte(finished, tmp_path):
    project, cohort, _ = finished
    results = tmp_path / "again"
    done = snakemake(project, str(results / "a/evaluate.h5"), *_keys(cohort, str(results)), "--cores", "1")
    assert done.returncode == 0, done.stdout
    made = sorted(results.glob("a/*.h5"))
    assert {path.name for path in made} >= {"solve.MLO.h5", "localize.h5", "evaluate.h5"}
    for path in made:
        assert path.read_bytes() == (project / "my results/a" / path.name).read_bytes(), path.name


def test_study_is_a_target_of_its_own(finished):
    project, cohort, _ = finished
    jobs = _jobs(snakemake(project, "-n", "error_vs_runtime", *_keys(cohort)).stdout)
    assert jobs == ["error_vs_runtime", "runtime"]


def test_paper_s_tables_are_made_of_the_volunteers_alone(finished):
    project, cohort, _ = finished
    assert _jobs(snakemake(project, "-n", "paper_tables", *_keys(cohort)).stdout) == ["paper_tables"]
    table = cohort / "cases.tsv"
    text = table.read_text()
    lines = [line.split("\t") for line in text.splitlines()]
    extra = [["mr_compressed", "mr_compressed_landmarks"], ["a.nii.gz", "points.tsv"], ["", ""]]
    table.write_text("".join("\t".join(row + more) + "\n" for row, more in zip(lines, extra, strict=True)))
    done = snakemake(project, "paper_tables", *_keys(cohort, "with volunteer"))
    table.write_text(text)
    assert done.returncode == 0, done.stdout
    results = project / "with volunteer"
    assert sorted(path.parent.name for path in results.glob("*/volunteer.h5")) == ["a"]
    assert (results / "tables" / "table_4_skin.csv").exists()
    assert not (results / "report.html").exists()


@pytest.fixture(scope="module")
def among_three(tmp_path_factory):
    """A cohort of three, one of them NaN, one with a bug in one of its views; tables and report are the real ones."""
    folder = tmp_path_factory.mktemp("three")
    project = make_project(folder / "project", real=("tables", "report"))
    cohort = make_cohort(folder / "data")
    spoil(cohort / "b.nii.gz")
    inject_bug(project, "compress", "(subject.case, subject.view) == ('c', 'MLO')")
    return project, snakemake(project, *_keys(cohort))


def test_volume_of_nan_and_a_bug_end_their_cases_only(among_three):
    project, _ = among_three
    results = project / "my results"
    assert (results / "a" / "figures.h5").exists()
    assert (results / "c" / "solve.CC.h5").exists()
    with (results / "tables" / "failures.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["case", "view", "stage", "status", "message"]
    assert rows[1] == ["b", "", "segment", "failed", "b.nii.gz: holds NaN; export the volume again"]
    assert rows[2][:4] == ["c", "MLO", "compress", "bug"]
    assert len(rows) == 3
    page = (results / "report.html").read_text()
    assert "1 of 3" in page
    assert "holds NaN" in page
    assert "stopped by a bug (ZeroDivisionError in stages.compress.stage.run)" in page


def test_failures_end_the_run_with_a_list_and_not_zero(among_three):
    project, done = among_three
    assert done.returncode != 0
    assert "2 of 3 cases did not finish" in done.stdout
    assert "b: segment: b.nii.gz: holds NaN" in done.stdout
    assert "c MLO: compress: stopped by a bug" in done.stdout
    for word in ("Traceback", "RuleException", "CalledProcessError", "Error in rule", "WorkflowError"):
        assert word not in done.stdout
    assert max(map(len, done.stdout.splitlines())) < 300
    assert not (project / "my results" / "tables" / "complete.txt").exists()


def test_traceback_stands_in_the_log_and_nowhere_else(among_three):
    project, done = among_three
    results = project / "my results"
    bug, data = (results / "logs" / name for name in ("c/compress.MLO.log", "b/segment.log"))
    assert " -m stages run compress " in bug.read_text().splitlines()[0]
    assert "ZeroDivisionError: /secret/Jane" in bug.read_text()
    assert "DataError" in data.read_text()
    assert "Traceback" in data.read_text()
    assert "/secret" not in done.stdout
    for path in (*(results / "c").glob("*.h5"), *(results / "tables").iterdir(), results / "report.html"):
        assert b"/secret" not in path.read_bytes(), path.name


def test_origin_is_shown_of_what_later_stages_pass_on(among_three):
    project, _ = among_three
    shown = subprocess.run(
        [sys.executable, "-m", "stages", "show", str(project / "my results" / "b" / "solve.CC.h5")],
        env=os.environ | {"PYTHONPATH": str(project / "src")},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "solve of b CC (R): failed\n  segment: b.nii.gz: holds NaN; export the volume again" in shown


def test_preflight_stops_before_the_first_job(tmp_path):
    project = make_project(tmp_path / "project")
    cohort = make_cohort(tmp_path / "data", ("a", "b"))
    (cohort / "a.nii.gz").unlink()
    (cohort / "b_CC.png").write_bytes(b"rubbish")
    done = snakemake(project, *_keys(cohort))
    assert done.returncode != 0
    assert "2 faults found before the first job" in done.stdout
    for word in ("Traceback", "WorkflowError", "common.smk"):
        assert word not in done.stdout
    assert not (project / "my results").exists()


def test_unknown_key_and_unknown_case(finished):
    project, cohort, _ = finished
    done = snakemake(project, "-n", "--config", "compres={level: 2}", *_keys(cohort)[1:])
    assert "config, key compres: is unknown; the nearest known one is 'compress'" in done.stdout
    done = snakemake(project, "-n", "my results/zz/segment.h5", *_keys(cohort))
    assert "no case 'zz' in" in done.stdout


def test_cohort_without_mammograms(finished):
    project, cohort, _ = finished
    done = snakemake(project, "-n", "--config", f"cases={cohort}/cases.tsv", "results=plain")
    assert done.returncode == 0, done.stdout
    assert "pose" not in _jobs(done.stdout)
    assert "segment" in _jobs(done.stdout)


def test_lint_finds_nothing_but_what_is_exempt(finished):
    project, cohort, _ = finished
    report = snakemake(project, "--lint", "json", *_keys(cohort))
    checked = subprocess.run(
        [sys.executable, str(PROJECT / "workflow/scripts/check_lint.py")],
        input=report.stdout,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


def test_entry_is_short():
    assert len((PROJECT / "Snakefile").read_text().splitlines()) <= 60
