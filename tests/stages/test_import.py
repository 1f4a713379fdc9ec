"""`mammoreg import`: a made-up PACS export of several patients becomes a cohort that `check` accepts."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from pydicom import dcmread
from pydicom.dataelem import RawDataElement
from pydicom.tag import Tag
from pydicom.uid import ImplicitVRLittleEndian, RLELossless, generate_uid

from stages.cohort.cases import read_cohort
from stages.cohort.preflight import check_cohort
from stages.cohort.readers.mammogram.image import read_mammogram
from stages.cohort.readers.mr.volume import read_mr
from stages.command.main import main
from tests.stages.cohort_files import COLUMNS, ROWS, write_dicom
from tests.stages.mr_series import again, linear_field, report, series, write, write_directory

SECRET = (
    "Doe^Jane",
    "Doe_Jane",
    "Roe^Ann",
    "Roe_Ann",
    "19700101",
    "2018",
    "2020051",
    "A77",
    "1.2.276",
    "t1_fl3d",
    "Unit 7",
)
ORIENTATION = {"RCC": ["P", "L"], "LCC": ["A", "R"], "RMLO": ["P", "FL"], "LMLO": ["A", "FR"]}


def write_views(folder: Path, patient: str, *views: str, study: str = "mammography", **elements: object) -> None:
    """Mammograms, named as a person would; a view is a side and a name."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, view in enumerate(views):
        shown = np.random.default_rng(number).integers(100, 4000, (ROWS, COLUMNS)).astype(np.uint16)
        values = {
            "PatientID": f"ID-{patient}",
            "PatientName": patient,
            "PatientBirthDate": "19700101",
            "StudyDate": "20180601",
            "AcquisitionTime": "080000",
            "InstitutionName": "Unit 7",
            "StudyInstanceUID": generate_uid(entropy_srcs=[patient, study]),
            "SOPInstanceUID": generate_uid(entropy_srcs=[patient, study, view, str(elements)]),
            "ImageLaterality": view[0],
            "ViewPosition": view[1:],
            "PatientOrientation": ORIENTATION.get(view, ["P", "L"]),
            "PresentationIntentType": "FOR PRESENTATION",
            "PixelData": shown.tobytes(),
        }
        name = f"{patient} {view} {len(list(folder.iterdir()))}"
        write_dicom(folder / name, **(values | elements))


@pytest.fixture
def export(tmp_path):
    """Two patients: MR of several series, four mammograms each, a spot view, a second image of a view, a report."""
    folder = tmp_path / "PACS"
    for patient, count in (("Doe^Jane", 9), ("Roe^Ann", 10)):
        place = folder / patient.replace("^", "_")
        fit = series("t1_fl3d_tra_pre", count=count, patient=patient, SeriesNumber=4)
        write(place / "MR" / "4", fit)
        write(
            place / "MR" / "5",
            again(
                fit,
                SeriesNumber=5,
                ContrastBolusAgent="Gd",
                SeriesInstanceUID="1.2.276.5",
                SeriesDescription="t1_fl3d_tra_post",
            ),
            "P",
        )
        write(place / "MR" / "6", series("t1_fl3d_SUB", patient=patient, SeriesNumber=6), "S")
        write(place / "MR" / "1", series("localizer", count=3, patient=patient, SeriesNumber=1), "L")
        write(place, [report(fit[0])], "SR")
        write_views(place / "MG", patient, "RCC", "LCC", "RMLO", "LMLO")
        write_views(place / "MG", patient, "RCC", BodyPartThickness=51, AcquisitionTime="083000")
    write_views(
        folder / "Doe_Jane" / "MG",
        "Doe^Jane",
        "RCC",
        PaddleDescription="SPOT",
        EstimatedRadiographicMagnificationFactor="1.8",
    )
    write_directory(folder / "disc", sorted((folder / "Doe_Jane" / "MR" / "4").iterdir())[:2])
    (folder / "viewer.exe").write_bytes(b"MZ" + bytes(200))
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def assert_no_secret(out: Path, export: Path) -> None:
    """Neither a name nor a date nor an identifier of any file of the export is in the result."""
    headers = [dcmread(path, force=True) for path in export.rglob("*") if path.is_file() and path.suffix != ".exe"]
    keywords = ("SOPInstanceUID", "StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID", "PatientID")
    secrets = {*SECRET, *(str(header[k].value) for header in headers for k in keywords if k in header)}
    for path in out.rglob("*"):
        content = path.name.encode() + (path.read_bytes() if path.is_file() else b"")
        assert not [secret for secret in secrets if secret.encode() in content], path


def test_an_export_of_two_patients_becomes_a_cohort(export, tmp_path, capsys):
    out = tmp_path / "cohort"
    assert main(["import", str(export), str(out)]) == 0
    assert "4 breasts with 8 mammograms, of 2 patients found" in capsys.readouterr().out
    cohort = read_cohort(out / "cases.tsv", out / "views.tsv")
    assert sorted(cohort.cases) == ["p1L", "p1R", "p2L", "p2R"]
    assert all(cohort.views(name) == ["CC", "MLO"] for name in cohort.cases)
    assert check_cohort(cohort) == []
    assert {(row["patient"], row["mr"]) for row in rows(out / "cases.tsv")} == {
        ("p1", "mr/p1.nii.gz"),
        ("p2", "mr/p2.nii.gz"),
    }
    assert_no_secret(out, export)
    assert {path.name for path in out.iterdir()} == {"cases.tsv", "views.tsv", "import.tsv", "mr", "mammograms"}


def test_what_is_taken_is_the_fitting_series_at_its_place(export, tmp_path):
    main(["import", str(export), str(tmp_path / "cohort")])
    counts = set()
    for name in ("p1", "p2"):
        volume = read_mr(tmp_path / "cohort" / "mr" / f"{name}.nii.gz")
        places = volume.to_world(np.moveaxis(np.indices(volume.shape), 0, -1))
        assert np.abs(volume.data - linear_field(places)).max() < 0.51
        counts.add(volume.shape[2])
    assert counts == {9, 10}


def test_the_account_says_why(export, tmp_path):
    main(["import", str(export), str(tmp_path / "cohort")])
    found = rows(tmp_path / "cohort" / "import.tsv")
    told = {(row["what"].split(",")[0], row["why"]) for row in found}
    assert ("MR series 4", "taken") in told
    assert ("MR series 5", "left: with contrast agent") in told
    assert ("MR series 6", "left: subtraction") in told
    assert ("MR series 1", "left: no volume") in told
    assert ("SR", "left: neither MR nor mammogram") in told
    assert any("magnification" in why or "spot" in why for what, why in told if what == "R CC")
    assert ("R CC", "left: another image of this view is better by the rule") in told
    assert any(what == "R CC" and "the better of 2 by the rule" in why for what, why in told)
    assert not any("files" in row for row in found)
    # Of two images of one view the later is taken.
    image = dcmread(tmp_path / "cohort" / "mammograms" / "p1R_CC.dcm")
    assert image.BodyPartThickness == 51
    assert image.PatientName == "p1"


def test_the_order_is_that_of_no_name_and_stays(export, tmp_path):
    main(["import", str(export), str(tmp_path / "one")])
    for number, place in enumerate(sorted(export.iterdir())):
        place.rename(export / f"moved {9 - number}")
    main(["import", str(export), str(tmp_path / "two")])
    for name in ("cases.tsv", "views.tsv", "mr/p1.nii.gz", "mammograms/p2L_MLO.dcm"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_links_and_paths_are_there_when_asked_for(export, tmp_path):
    out = tmp_path / "cohort"
    assert main(["import", str(export), str(out), "--link", "--with-paths"]) == 0
    cohort = read_cohort(out / "cases.tsv", out / "views.tsv")
    assert check_cohort(cohort) == []
    assert cohort.cases["p1R"].mr.is_dir()
    assert (out / "mammograms" / "p1R_CC.dcm").is_symlink()
    assert all(row["files"] for row in rows(out / "import.tsv") if row["used_for"])


def test_a_folder_that_is_there_stays_and_nothing_is_left_of_a_failure(export, tmp_path, capsys):
    out = tmp_path / "cohort"
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    assert main(["import", str(export), str(out)]) == 1
    assert "is there already; name a folder that is not" in capsys.readouterr().err
    assert [path.name for path in out.iterdir()] == ["mine.txt"]
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    (nothing / "letter.txt").write_text("no DICOM")
    assert main(["import", str(nothing), str(tmp_path / "none")]) == 1
    assert "holds no breast with MR and a mammogram; nothing in it is DICOM" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    assert not list(tmp_path.glob(".*"))


def test_examinations_are_paired_by_their_days(tmp_path):
    """Two MR examinations and mammograms of three days: each goes to the nearest, and the account says so."""
    for study, day, number in (("first", "20180512", 4), ("second", "20200512", 5)):
        write(tmp_path / "in" / study, series("t1", study=study, StudyDate=day, SeriesNumber=number))
    for study, day in (("a", "20180601"), ("b", "20200501"), ("c", "20190301")):
        write_views(tmp_path / "in" / study, "Doe^Jane", "RCC", study=study, StudyDate=day)
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out")]) == 0
    cases = rows(tmp_path / "out" / "cases.tsv")
    assert [(row["case"], row["exam"]) for row in cases] == [("p1e1R", "e1"), ("p1e2R", "e2")]
    told = [row["why"] for row in rows(tmp_path / "out" / "import.tsv") if row["what"].startswith("R CC")]
    assert sum(why.startswith("taken") for why in told) == 2
    assert any(re.match(r"left: 293 days from the MR, others 20", why) for why in told)
    assert_no_secret(tmp_path / "out", tmp_path / "in")


def test_a_breast_whose_pixels_cannot_be_read_does_not_stop_the_others(tmp_path, capsys):
    for patient in ("Doe^Jane", "Roe^Ann"):
        slices = series("t1", patient=patient)
        if patient == "Roe^Ann":
            slices[3].PixelData = slices[3].PixelData[:50]
        write(tmp_path / "in" / f"mr {patient}", slices)
        write_views(tmp_path / "in" / f"mg {patient}", patient, "RCC")
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out")]) == 0
    assert "1 breast with 1 mammogram, of 2 patients found" in capsys.readouterr().out
    assert len(rows(tmp_path / "out" / "cases.tsv")) == len(rows(tmp_path / "out" / "views.tsv")) == 1
    last = rows(tmp_path / "out" / "import.tsv")[-1]
    assert last["why"] == "left after all: pixels are missing or cannot be decoded; export the series again"
    assert_no_secret(tmp_path / "out", tmp_path / "in")


def test_implants_and_images_without_side_are_left(tmp_path):
    write(tmp_path / "in" / "mr", series("t1"))
    write_views(tmp_path / "in" / "mg", "Doe^Jane", "RCC")
    write_views(tmp_path / "in" / "mg", "Doe^Jane", "LCC", BreastImplantPresent="YES")
    write_views(tmp_path / "in" / "mg", "Doe^Jane", "RMLO", ImageLaterality=None)
    write_views(tmp_path / "in" / "mg", "Doe^Jane", "RMLO", ImagerPixelSpacing=None)
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out")]) == 0
    assert [row["case"] for row in rows(tmp_path / "out" / "cases.tsv")] == ["p1R"]
    told = " / ".join(row["why"] for row in rows(tmp_path / "out" / "import.tsv"))
    assert "breast implant" in told
    assert "which side and view it is" in told
    assert "pixel spacing" in told
    assert "has MR and no mammogram that can be used" in told


@pytest.mark.parametrize("form", ["RLE", "implicit", "decimal comma"])
def test_copies_keep_pixels_and_numbers_however_they_were_stored(tmp_path, form):
    """Compressed pixels, values without a type and numbers that are none for DICOM come through as they are."""
    write(tmp_path / "in" / "mr", series("t1"))
    write_views(tmp_path / "in" / "mg", "Doe^Jane", "RCC")
    (path,) = (tmp_path / "in" / "mg").iterdir()
    header = dcmread(path)
    pixels = header.pixel_array.copy()
    if form == "RLE":
        header.compress(RLELossless)
    elif form == "implicit":
        header.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
    else:
        header._dict[Tag("BodyPartThickness")] = RawDataElement(
            Tag("BodyPartThickness"), "DS", 4, b"52,5", 0, False, True
        )
    header.save_as(path, enforce_file_format=True)
    assert main(["import", str(tmp_path / "in"), str(tmp_path / "out")]) == 0
    copy = tmp_path / "out" / "mammograms" / "p1R_CC.dcm"
    one, other = (read_mammogram(file, {}, "R", "CC") for file in (path, copy))
    assert np.array_equal(one.pixels, other.pixels)
    assert np.array_equal(dcmread(copy).pixel_array, pixels)
    assert one.facts == other.facts
    assert one.facts.thickness_mm == (52.5 if form == "decimal comma" else 50.0)
    assert_no_secret(tmp_path / "out", tmp_path / "in")
