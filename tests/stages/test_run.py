"""Running a stage: what is checked, passed on and recorded."""

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import Field

from mammoreg.errors import DataError, NotConvergedError
from stages.engine.artefact import Array, Artefact, Fields
from stages.engine.contract import SettingsModel, Stage, Subject
from stages.engine.errors import UserError
from stages.engine.failures import Failure
from stages.engine.run import command_line, content_id, execute


class Settings(SettingsModel):
    factor: float = Field(2.0, gt=0)
    steps: int = Field(3, ge=1)


def _double(inputs, settings, subject):
    number = float(inputs.path("mr").read_text())
    if number < 0:
        raise DataError(f"{inputs.path('mr')}: is negative; give another")
    if number > 100:
        raise NotConvergedError("no answer after 3 steps")
    return Fields(arrays={"x": Array(np.array([settings.factor * number]), "mm", "x")}, files={"note.txt": b"note"})


SEGMENT = Stage("segment", 1, ("mr",), Settings, _double, optional=("mr_labels",))
MESH = Stage("mesh", 1, ("segment",), Settings, lambda inputs, settings, subject: Fields(values={"called": True}))
TABLES = Stage(
    "tables",
    1,
    ("segment",),
    Settings,
    lambda inputs, settings, subject: Fields(values={"seen": [a.status for a in inputs.artefacts("segment")]}),
    takes_failed=True,
)
SUBJECT = Subject("c1", "L", None, {"thickness_mm": "52.5"})


def _run(stage, inputs, output, settings=None, code="code"):
    return execute(stage, code, inputs, output, settings or {}, SUBJECT)


@pytest.fixture
def mr(tmp_path):
    path = tmp_path / "data" / "mr.txt"
    path.parent.mkdir()
    path.write_text("4")
    return path


def test_artefact_holds_result_and_where_it_comes_from(tmp_path, mr):
    output = tmp_path / "out" / "segment.h5"
    assert _run(SEGMENT, {"mr": mr}, output, {"factor": "1e1"}).status == "ok"
    found = Artefact(output)
    assert found.array("x", "mm") == [40.0]
    assert json.loads(found.attrs["settings"]) == {"factor": 10.0, "steps": 3}
    assert json.loads(found.attrs["inputs"]) == {"mr": [content_id(mr)]}
    assert json.loads(found.attrs["row"]) == {"thickness_mm": "52.5"}
    assert json.loads(found.attrs["software"])["numpy"] == np.__version__
    assert (found.case, found.laterality, found.view, found.stage) == ("c1", "L", None, "segment")
    assert (tmp_path / "out" / "segment" / "note.txt").read_bytes() == b"note"


def test_bytes_do_not_depend_on_place_or_time(tmp_path, mr):
    copy = tmp_path / "elsewhere.txt"
    copy.write_text("4")
    _run(SEGMENT, {"mr": mr}, tmp_path / "one.h5")
    _run(SEGMENT, {"mr": copy}, tmp_path / "two" / "two.h5")
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two" / "two.h5").read_bytes()
    assert str(tmp_path).encode() not in (tmp_path / "one.h5").read_bytes()


@pytest.mark.parametrize(
    "change", [{"settings": {"factor": 3}}, {"code": "other"}, {"content": "5"}], ids=["settings", "code", "input"]
)
def test_identity_follows_settings_code_and_inputs(tmp_path, mr, change):
    _run(SEGMENT, {"mr": mr}, tmp_path / "one.h5")
    mr.write_text(change.get("content", "4"))
    _run(SEGMENT, {"mr": mr}, tmp_path / "two.h5", change.get("settings"), change.get("code", "code"))
    one, two = (Artefact(tmp_path / name).attrs["artefact_id"] for name in ("one.h5", "two.h5"))
    assert one != two


@pytest.mark.parametrize(
    ("number", "status", "message"),
    [
        ("-1", "failed", "segment: mr.txt: is negative; give another"),
        ("200", "not_converged", "segment: no answer after 3 steps"),
    ],
)
def test_bad_data_ends_as_an_artefact_that_later_stages_pass_on(tmp_path, mr, number, status, message):
    mr.write_text(number)
    fields = _run(SEGMENT, {"mr": mr}, tmp_path / "segment.h5")
    assert (fields.status, fields.message) == (status, message)
    _run(MESH, {"segment": tmp_path / "segment.h5"}, tmp_path / "mesh.h5")
    mesh = Artefact(tmp_path / "mesh.h5")
    assert (mesh.status, mesh.message) == (status, message)
    assert not mesh.has("called")
    _run(TABLES, {"segment": [tmp_path / "segment.h5", tmp_path / "segment.h5"]}, tmp_path / "tables.h5")
    assert Artefact(tmp_path / "tables.h5").value("seen") == [status, status]


def _stage(name, error, **more):
    """A stage that ends with an exception; one whose name is a cohort's stage stands for that."""

    def run(inputs, settings, subject):
        raise error

    return Stage(name, 1, (), Settings, run, **more)


def _ended(tmp_path, stage, subject=SUBJECT):
    execute(stage, "code", {}, tmp_path / "x.h5", {}, subject)
    return Artefact(tmp_path / "x.h5")


def test_origin_is_typed_and_passed_on_unchanged(tmp_path):
    subject = Subject("c1", "L", "CC")
    pose = Stage("pose", 1, (), Settings, lambda inputs, settings, subject: _raise(DataError("a: b: c")))
    execute(pose, "code", {}, tmp_path / "pose.h5", {}, subject)
    solve = Stage("solve", 1, ("pose",), Settings, pose.run)
    execute(solve, "code", {"pose": tmp_path / "pose.h5"}, tmp_path / "solve.h5", {}, subject)
    project = Stage("project", 1, ("solve",), Settings, pose.run)
    execute(project, "code", {"solve": tmp_path / "solve.h5"}, tmp_path / "project.h5", {}, Subject("c1", "L", "MLO"))
    for name in ("pose", "solve", "project"):
        found = Artefact(tmp_path / f"{name}.h5")
        assert found.failure == Failure("pose", "CC", "failed", "a: b: c")
        assert (found.attrs["status"], found.attrs["failed_stage"], found.attrs["failed_view"]) == (
            "failed",
            "pose",
            "CC",
        )
        assert found.attrs["message"] == "a: b: c"


def _raise(error):
    raise error


def test_a_bug_ends_its_case_with_a_message_and_a_traceback_in_the_log(tmp_path, caplog):
    found = _ended(tmp_path, _stage("mesh", KeyError(f"{tmp_path}: Jane Doe")))
    assert (found.failure.stage, found.status) == ("mesh", "bug")
    assert "stopped by a bug (KeyError in tests.stages.test_run.run)" in found.message
    for secret in (str(tmp_path), "Jane", "Traceback"):
        assert secret not in found.message
    assert "KeyError" in caplog.text
    assert "in run\n" in caplog.text


@pytest.mark.parametrize("error", [MemoryError(), KeyboardInterrupt()])
def test_want_of_memory_and_an_interrupt_end_the_job(tmp_path, error):
    with pytest.raises(type(error)):
        _ended(tmp_path, _stage("mesh", error))
    assert not (tmp_path / "x.h5").exists()


def test_a_bug_in_a_stage_of_the_cohort_ends_the_job(tmp_path):
    with pytest.raises(KeyError):
        _ended(tmp_path, _stage("tables", KeyError("x")))
    assert not (tmp_path / "x.h5").exists()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (UserError("give the input segment"), "give the input segment"),
        (PermissionError(13, "Permission denied", "/home/jane/mr.nii"), "mr.nii: Permission denied; mend it"),
    ],
)
def test_what_a_user_can_mend_is_no_bug(tmp_path, error, message):
    found = _ended(tmp_path, _stage("segment", error))
    assert found.status == "failed"
    assert found.failure.message.startswith(message)
    assert "jane" not in found.message


@pytest.mark.parametrize("error", [DataError("no lesion"), ZeroDivisionError()])
def test_a_stage_without_result_names_what_is_missing(tmp_path, error):
    def rows(inputs, failure):
        return {"rows": [{"name": "mass", "status": failure.status}]}

    found = _ended(tmp_path, _stage("localize", error, without_result=rows))
    assert found.value("rows") == [{"name": "mass", "status": found.status}]


def test_a_bug_in_naming_what_is_missing_leaves_the_first_failure(tmp_path):
    broken = _stage("localize", DataError("no lesion"), without_result=lambda inputs, failure: 1 / 0)
    assert _ended(tmp_path, broken).message == "localize: no lesion"


def test_all_wrong_settings_are_named_at_once(tmp_path, mr):
    with pytest.raises(UserError) as caught:
        _run(SEGMENT, {"mr": mr}, tmp_path / "x.h5", {"factor": -1, "steps": 0.5, "stpes": 3})
    for part in ("segment.factor", "greater than 0", "segment.steps", "segment.stpes"):
        assert part in str(caught.value)


def test_inputs_must_be_those_of_the_stage(tmp_path, mr):
    with pytest.raises(UserError, match="segment takes no input mrr; it takes mr, mr_labels"):
        _run(SEGMENT, {"mrr": mr}, tmp_path / "x.h5")
    with pytest.raises(UserError, match="segment needs the input mr; give it with --in name=path"):
        _run(SEGMENT, {"mr_labels": mr}, tmp_path / "x.h5")


def test_folder_is_known_by_its_files(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name / "sub").mkdir(parents=True)
        (tmp_path / name / "sub" / "IM1").write_bytes(b"slice")
    assert content_id(tmp_path / "one") == content_id(tmp_path / "two")
    (tmp_path / "two" / "sub" / "IM1").rename(tmp_path / "two" / "sub" / "IM2")
    assert content_id(tmp_path / "one") != content_id(tmp_path / "two")


def test_command_line_can_be_pasted():
    subject = Subject("c1", "L", "CC", {"orientation": "A\\R"})
    text = command_line("pose", {"mesh": ["a b.h5"], "image": "x.dcm"}, "out.h5", {"a": 1}, subject)
    words = shlex.split(text)
    assert words[:8] == ["cd", str(Path.cwd()), "&&", sys.executable, "-m", "stages", "run", "pose"]
    for pair in (["--view", "CC"], ["--row", "orientation=A\\R"], ["--in", "mesh=a b.h5"], ["--settings", '{"a": 1}']):
        assert pair in [words[i : i + 2] for i in range(len(words))]
