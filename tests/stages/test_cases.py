"""Both tables: what they accept, and every fault with its place and remedy."""

from pathlib import Path

import pytest

from stages.cohort.cases import read_cohort
from stages.engine.errors import FaultsError
from tests.shared_data import DATA, requires_shared
from tests.stages.cohort_files import write_tsv

CASE = {"case": "c1", "laterality": "L", "mr": "mr.nii.gz"}
VIEW = {"case": "c1", "view": "CC", "image": "cc.dcm"}


def _read(folder, cases=(CASE,), views=(VIEW,)):
    tables = write_tsv(folder / "cases.tsv", *cases), write_tsv(folder / "views.tsv", *views)
    return read_cohort(*tables)


def _faults(folder, cases=(CASE,), views=(VIEW,)):
    with pytest.raises(FaultsError) as caught:
        _read(folder, cases, views)
    return [str(fault) for fault in caught.value.faults]


def test_paths_are_relative_to_the_table(tmp_path):
    cohort = _read(tmp_path, [CASE | {"mr_labels": "/absolute/labels.nii.gz"}])
    assert cohort.cases["c1"].files() == {
        "mr": tmp_path / "mr.nii.gz",
        "mr_labels": Path("/absolute/labels.nii.gz"),
    }


def test_values_are_handed_on_as_texts_and_empty_cells_are_left_out(tmp_path):
    cohort = _read(tmp_path, [CASE | {"compression": "2.1e-1"}], [VIEW | {"thickness_mm": "52", "force_n": ""}])
    assert cohort.cases["c1"].values() == {"compression": "0.21"}
    assert cohort.mammograms["c1", "CC"].values() == {"thickness_mm": "52.0"}


@pytest.mark.parametrize(
    ("case", "views", "expected"),
    [
        ({}, ["MLO", "CC"], ["CC", "MLO"]),
        ({"mr_compressed": "b.nii.gz"}, ["CC"], ["CC"]),
        ({"mr_compressed": "b.nii.gz"}, [], ["3D"]),
        ({"compression": "0.2"}, [], ["3D"]),
        ({}, [], []),
    ],
)
def test_views_of_a_case(tmp_path, case, views, expected):
    tables = write_tsv(tmp_path / "cases.tsv", CASE | case), None
    if views:
        tables = tables[0], write_tsv(tmp_path / "views.tsv", *[VIEW | {"view": view} for view in views])
    assert read_cohort(*tables).views("c1") == expected


def test_excluded_rows_are_kept_but_do_not_run(tmp_path):
    again = VIEW | {"exclude": "motion", "image": "first.dcm"}
    other = CASE | {"case": "c2", "exclude": "implant"}
    cohort = _read(tmp_path, [CASE, other], [again, VIEW, VIEW | {"case": "c2"}])
    assert list(cohort.cases) == ["c1"]
    assert list(cohort.mammograms) == [("c1", "CC")]
    assert [row.exclude for row in cohort.all_cases] == [None, "implant"]
    assert len(cohort.all_views) == 3


@pytest.mark.parametrize("name", ["tables", "figures", "benchmarks", "logs", "digital"])
def test_names_that_the_results_folder_uses(tmp_path, name):
    (fault,) = _faults(tmp_path, [CASE | {"case": name}], [VIEW | {"exclude": "x"}])[:1]
    assert fault.startswith(f"cases.tsv row 2 ({name}), column case: '{name}' is not permitted")


@pytest.mark.parametrize(
    ("cases", "views", "message"),
    [
        (
            [CASE | {"laterality": "left"}],
            [],
            "cases.tsv row 2 (c1), column laterality: 'left' is not permitted: Input should be 'L' or 'R'",
        ),
        ([CASE | {"mr": ""}], [], "cases.tsv row 2 (c1), column mr: is empty; give it"),
        (
            [CASE | {"compression": "21"}],
            [],
            "column compression: '21' is not permitted: Input should be less than 0.9",
        ),
        ([CASE | {"case": "a b"}], [], "column case: 'a b' is not permitted: String should match pattern"),
        (
            [CASE | {"mr_lesions": "x"}],
            [],
            "cases.tsv row 1: unknown column 'mr_lesions'; the nearest known one is 'mr_lesion'",
        ),
        ([CASE, CASE], [], "cases.tsv row 3: c1 is already in row 2; keep one"),
        (
            [CASE | {"mr_compressed_landmarks": "x"}],
            [],
            "mr_compressed_landmarks is given without mr_compressed; give mr_compressed as well",
        ),
        ([CASE], [VIEW, VIEW], "views.tsv row 3: c1 CC is already in row 2; keep one of the rows, or exclude one view"),
        ([CASE], [VIEW | {"view": "X"}], "column view: 'X' is not permitted: no such view; known are CC, MLO, ML, LM,"),
        ([CASE], [VIEW | {"view": "MCC"}], "column view: 'MCC' is not permitted: a magnification view cannot be"),
        ([CASE], [VIEW | {"view": "SPOT"}], "column view: 'SPOT' is not permitted: a spot compression view cannot be"),
        ([CASE], [VIEW | {"angle_deg": "nan"}], "column angle_deg: 'nan' is not permitted"),
        ([CASE], [VIEW | {"thickness_mm": "72,0"}], "column thickness_mm: '72,0' is not permitted"),
        (
            [CASE],
            [VIEW | {"case": "c9"}],
            "views.tsv row 2 (c9 CC): no case 'c9' in cases.tsv; add it there or correct the id",
        ),
        (
            [CASE],
            [VIEW | {"thickness_mm": "-5"}],
            "column thickness_mm: '-5' is not permitted: Input should be greater than 0",
        ),
        (
            [CASE],
            [VIEW | {"pixel_spacing_mm": "0"}],
            "column pixel_spacing_mm: '0' is not permitted: Input should be greater than 0",
        ),
        ([CASE], [VIEW | {"orientation": "sideways"}], "column orientation: 'sideways' is not permitted"),
        (
            [CASE],
            [VIEW | {"image": "cc.png"}],
            "a picture has no header, and the column pixel_spacing_mm is empty; give the pixel spacing",
        ),
    ],
)
def test_fault_names_file_row_and_remedy(tmp_path, cases, views, message):
    assert any(message in fault for fault in _faults(tmp_path, cases, views or [VIEW | {"exclude": "x"}]))


def test_all_faults_come_at_once(tmp_path):
    views = [VIEW | {"view": "X", "thickness_mm": "a"}, VIEW, VIEW | {"case": "c9"}]
    faults = _faults(tmp_path, [CASE | {"laterality": "Q", "compression": "5"}], views)
    assert len(faults) == 5
    assert not any("no case 'c1'" in fault for fault in faults), "the row of c1 is there, though faulty"


def test_missing_required_column_and_spaces_for_tabs(tmp_path):
    (tmp_path / "cases.tsv").write_text("case laterality mr\nc1 L mr.nii.gz\n")
    with pytest.raises(FaultsError, match="separate columns by tabs"):
        read_cohort(tmp_path / "cases.tsv", None)


def test_surplus_cells(tmp_path):
    (tmp_path / "cases.tsv").write_text("case\tlaterality\tmr\nc1\tL\tmr.nii.gz\tmore\n")
    with pytest.raises(FaultsError, match="row 2 \\(c1\\): 4 cells under 3 columns; remove the surplus"):
        read_cohort(tmp_path / "cases.tsv", None)


def test_table_that_is_not_there_or_empty(tmp_path):
    with pytest.raises(FaultsError, match="no.tsv: cannot be read \\(No such file or directory\\)"):
        read_cohort(tmp_path / "no.tsv", None)
    (tmp_path / "cases.tsv").write_text("case\tlaterality\tmr\n")
    with pytest.raises(FaultsError, match="cases.tsv: the table has no row; add one row per breast"):
        read_cohort(tmp_path / "cases.tsv", None)


def test_table_as_spreadsheets_write_it(tmp_path):
    path = tmp_path / "cases.tsv"
    path.write_bytes("\ufeffcase\tlaterality\tmr\tmr_lesion\r\nc1\tL\tmr.nii.gz\r\n\t\t\t\r\n".encode())
    assert list(read_cohort(path, None).cases) == ["c1"]


def test_table_with_other_separators_quotes_and_trailing_tabs(tmp_path):
    path = tmp_path / "cases.tsv"
    for text in (
        "case\tlaterality\tmr\t\nc1\tL\tmr.nii.gz\t\n",
        '"case";"laterality";"mr"\r\n"c1";"L";"mr.nii.gz"\r\n',
        'case,laterality,mr\nc1,L,"mr.nii.gz"\n',
    ):
        path.write_text(text)
        assert read_cohort(path, None).cases["c1"].mr == tmp_path / "mr.nii.gz"


def test_cells_under_no_name(tmp_path):
    (tmp_path / "cases.tsv").write_text("case\tlaterality\t\tmr\nc1\tL\tx\tmr.nii.gz\n")
    with pytest.raises(FaultsError, match="row 1: a column with cells has no name; name it or empty its cells"):
        read_cohort(tmp_path / "cases.tsv", None)


def test_swapped_tables_are_said_once(tmp_path):
    cases, views = write_tsv(tmp_path / "a.tsv", CASE), write_tsv(tmp_path / "b.tsv", VIEW)
    with pytest.raises(FaultsError) as error:
        read_cohort(views, cases)
    (fault,) = error.value.faults
    assert "b.tsv and " in str(fault)
    assert "a.tsv: these tables are swapped; give the table of the breasts first" in str(fault)


@requires_shared("twins")
@pytest.mark.parametrize(("folder", "cases", "views"), [("twins", 3, 4), ("victre", 1, 1), ("mri", 12, 0)])
def test_tables_of_the_development_data(folder, cases, views):
    path = DATA / folder / "views.tsv"
    cohort = read_cohort(DATA / folder / "cases.tsv", path if path.exists() else None)
    assert (len(cohort.cases), len(cohort.mammograms)) == (cases, views)


def test_an_unknown_column_hides_no_other_fault(tmp_path):
    faults = _faults(tmp_path, [CASE | {"mr_lesions": "x", "laterality": "left"}])
    assert any("unknown column 'mr_lesions'" in fault for fault in faults)
    assert any("column laterality: 'left' is not permitted" in fault for fault in faults)


@pytest.mark.parametrize(
    ("column", "good", "bad"),
    [("mr_series", "1.2.840.10008.5", "t1 fs"), ("patient", "p1", "Jane Doe"), ("exam", "e2", "2018/05/12")],
)
def test_names_of_series_and_persons(tmp_path: Path, column: str, good: str, bad: str) -> None:
    """A series has a number or a UID, of which artefacts and logs see a digest alone; persons have pseudonyms."""
    table = tmp_path / "cases.tsv"
    table.write_text(f"case\tlaterality\tmr\t{column}\nc1\tL\tMR\t{good}\n")
    row = read_cohort(table, None).cases["c1"]
    assert getattr(row, column) == good
    assert good not in row.values().values()
    table.write_text(f"case\tlaterality\tmr\t{column}\nc1\tL\tMR\t{bad}\n")
    with pytest.raises(FaultsError, match=f"column {column}"):
        read_cohort(table, None)
