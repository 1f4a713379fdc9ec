"""What a stage may read, as its record declares it: `run_stage` refuses any other input, the rules offer no other."""

import pytest

from stages.cohort.cases import CaseRow, ViewRow
from stages.engine.contract import Subject
from stages.engine.errors import UserError
from stages.engine.registry import CASE_STAGES, STAGE_MODULES, VIEW_STAGES, load_stage
from stages.engine.run import run_stage
from stages.views import IMAGED
from tests.stages.synthetic_case import write_case

MARKS = {"mr_lesion", "mr_landmarks", "mr_compressed_landmarks", "mr_surface_points", "mr_compressed_surface_points"}
MARKS |= {f"{kind}{view}" for kind in ("lesion", "landmarks") for view in ("", "_CC", "_MLO")}
BEFORE = ("segment", "mesh", *(stage for stage in VIEW_STAGES if stage != "project"))


def _files(stage):
    record = load_stage(stage)
    columns = {*CaseRow.model_fields, *ViewRow.model_fields, *MARKS}
    return {*record.inputs, *record.optional} & columns


def test_marks_are_those_of_the_tables():
    assert {"mr_lesion", "lesion", "landmarks"} <= {*CaseRow.model_fields, *ViewRow.model_fields} & MARKS


@pytest.mark.parametrize("stage", BEFORE)
def test_no_stage_before_project_reads_marks(stage):
    assert not _files(stage) & MARKS


def test_pixels_and_intensities_are_read_once():
    readers = {
        column: [stage for stage in (*CASE_STAGES, *VIEW_STAGES) if column in _files(stage)]
        for column in ("mr", "mr_labels", "mr_compressed", "image")
    }
    assert readers["mr_compressed"] == ["segment"], "nothing after segment reads the second volume's intensities"
    assert readers["mr_labels"] == ["segment"]
    assert readers["image"] == ["pose"]
    imaged = {f"image_{view}" for view in IMAGED}
    takers = [stage for stage in STAGE_MODULES if imaged & {*load_stage(stage).inputs, *load_stage(stage).optional}]
    assert takers[0] == "segment", "which asks how deep a breast they show"
    assert not set(takers) & {"mesh", "compress", "shape", "solve", "project", "localize", "evaluate"}
    assert "segment" in readers["mr"]
    assert not set(readers["mr"]) & {"compress", "shape", "solve", "localize"}


def test_localize_reads_no_truth():
    marks = _files("localize") & MARKS
    assert marks == {"mr_lesion", "mr_landmarks", "lesion_CC", "lesion_MLO"}


@pytest.mark.parametrize("name", ["landmarks_CC", "mr_compressed_landmarks"])
def test_truth_that_is_handed_over_all_the_same_is_refused(tmp_path, name):
    inputs = write_case(tmp_path)
    path = tmp_path / "truth.tsv"
    path.write_text("name\tx\ty\tz\nP1\t1\t2\t3\n")
    with pytest.raises(UserError, match=f"localize takes no input {name}"):
        run_stage("localize", inputs | {name: path}, tmp_path / "localize.h5", {}, Subject("case1"))
