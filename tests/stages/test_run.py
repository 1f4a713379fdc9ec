"""Running a stage: what is checked, passed on and recorded."""

import json
import shlex

import numpy as np
import pytest
from pydantic import Field

from mammoreg.errors import DataError, NotConvergedError
from stages.engine.artefact import Array, Artefact, Fields
from stages.engine.contract import SettingsModel, Stage, Subject
from stages.engine.errors import UserError
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


def test_bugs_raise(tmp_path, mr):
    mr.write_text("no number")
    with pytest.raises(ValueError, match="could not convert"):
        _run(SEGMENT, {"mr": mr}, tmp_path / "segment.h5")
    assert not (tmp_path / "segment.h5").exists()


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
    assert words[:5] == ["python", "-m", "stages", "run", "pose"]
    for pair in (["--view", "CC"], ["--row", "orientation=A\\R"], ["--in", "mesh=a b.h5"], ["--settings", '{"a": 1}']):
        assert pair in [words[i : i + 2] for i in range(len(words))]
