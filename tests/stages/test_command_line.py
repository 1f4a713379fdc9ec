"""`python -m stages`: check, show and export, and errors without a traceback."""

from dataclasses import replace

import nibabel
import numpy as np
import pytest
from PIL import Image

from mammoreg.geometry import Volume, breast_to_lps, breast_to_plate, plate_to_breast
from mammoreg.meshing.block import BlockMesh
from stages.__main__ import main
from stages.engine.artefact import Array, Fields, VolumeField, write_artefact
from tests.stages.cohort_files import write_cohort

ATTRS = {
    "stage": "mesh",
    "schema": "1",
    "case": "c1",
    "view": "CC",
    "laterality": "L",
    "artefact_id": "x",
    "package_version": "0.1.0",
    "code": "0123456789abcdef",
    "frame": "LPS, mm",
    "settings": '{"elements":2}',
    "row": "{}",
    "inputs": '{"segment": ["x"]}',
}


@pytest.fixture
def artefact(tmp_path):
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    block = BlockMesh(2, 10 * grid)
    volume = Volume(
        np.arange(24, dtype=np.float32).reshape(2, 3, 4), np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 0.5]), "LPS"
    )
    between = replace(volume, frame="plate")
    fields = Fields(
        arrays={
            "points": Array(block.points, "mm", "node positions"),
            "gland_fraction": Array(np.linspace(0, 1, 8), "1", "share of gland"),
        },
        volumes={"mr": VolumeField(volume, "1", "MR signal"), "updated/mr": VolumeField(between, "1", "MR")},
        values={"rows": [{"name": "P1", "x_mm": 1.5}, {"name": "P2", "x_mm": None}], "n": 2},
    )
    path = tmp_path / "mesh.h5"
    write_artefact(path, ATTRS, fields)
    return path


def test_show_says_what_is_in_it(artefact, capsys):
    assert main(["show", str(artefact)]) == 0
    text = capsys.readouterr().out
    for line in (
        "mesh of c1 CC (L): ok",
        'settings {"elements":2}',
        "  points 27 x 3 mm, 0 to 20: node positions",
        "  mr 2 x 3 x 4 1 (LPS): MR signal",
        "  updated/mr 2 x 3 x 4 1 (plate): MR",
        "  n = 2",
    ):
        assert line in text.splitlines()


def test_export_writes_what_other_programs_open(artefact, tmp_path, capsys):
    assert main(["export", str(artefact), "--to", str(tmp_path / "out")]) == 0
    import meshio

    mesh = meshio.read(tmp_path / "out" / "points.vtu")
    assert mesh.cells[0].data.shape == (8, 8)
    np.testing.assert_allclose(mesh.cell_data["gland_fraction"][0], np.linspace(0, 1, 8))
    image = nibabel.load(tmp_path / "out" / "mr.nii.gz")
    # NIfTI's world is RAS: x and y of LPS change their sign.
    np.testing.assert_allclose(image.affine @ [1, 2, 3, 1], [-2.0, -6.0, 4.5, 1.0])
    assert image.get_fdata()[1, 2, 3] == 23
    assert (tmp_path / "out" / "rows.csv").read_text() == "name,x_mm\nP1,1.5\nP2,\n"
    captured = capsys.readouterr()
    assert "not written: updated/mr: its artefact does not hold the angle of its plates" in captured.err
    assert not (tmp_path / "out" / "updated.mr.nii.gz").exists()
    assert "points.vtu: node positions (mm)" in (tmp_path / "out" / "README.txt").read_text()


def pressed_artefact(path, laterality, view="CC"):
    """A block, two of its nodes, a volume and images, all turned into the plate frame at 40 degrees."""
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    block = 10 * grid + [5.0, -60.0, 20.0]
    plates = breast_to_plate(block, 40.0)
    data = np.zeros((4, 5, 6), dtype=np.float32)
    data[3, 1, 2] = 7.0
    volume = Volume(data, np.array([1.0, -50.0, 3.0]), np.array([1.0, 2.0, 0.5]), "plate")
    fields = Fields(
        arrays={
            "deformed": Array(plates, "mm", "nodes, plate frame", "plate"),
            "surface": Array(plates[:2], "mm", "places, plate frame", "plate"),
            "projection": Array(np.linspace(0.0, 2.5, 120).reshape(10, 12), "1", "attenuation"),
            "mask": Array(np.eye(12, dtype=np.uint8)[:10], "1", "silhouette"),
            "contact/anchor": Array(np.zeros((2, 3, 4, 3)), "mm", "contact points"),
        },
        volumes={"updated/mr": VolumeField(volume, "1", "MR volume")},
        values={"angle_deg": 40.0},
    )
    write_artefact(path, ATTRS | {"stage": "solve", "laterality": laterality, "view": view}, fields)
    return breast_to_lps(block, laterality), volume


@pytest.mark.parametrize("laterality", ["R", "L"])
def test_what_the_plates_frame_holds_is_exported_in_patient_coordinates(tmp_path, laterality):
    import meshio

    nodes, volume = pressed_artefact(tmp_path / "solve.h5", laterality)
    out = tmp_path / "out"
    assert main(["export", str(tmp_path / "solve.h5"), "--to", str(out)]) == 0
    mesh = meshio.read(out / "deformed.vtu")
    np.testing.assert_allclose(mesh.points, nodes, atol=1e-9)
    corners = mesh.points[mesh.cells_dict["hexahedron"]]
    edges = [corners[:, i] - corners[:, 0] for i in (1, 3, 4)]
    np.testing.assert_allclose(np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2]), 1000.0)
    assert "LPS_mm" in mesh.field_data
    header, *lines = (out / "surface.csv").read_text().splitlines()
    assert header == '"x (surface, mm)","y (surface, mm)","z (surface, mm)"'
    np.testing.assert_allclose([[float(x) for x in line.split(",")] for line in lines], nodes[:2], atol=1e-9)
    image = nibabel.load(out / "updated.mr.nii.gz")
    (bright,) = np.argwhere(image.get_fdata() == 7.0)
    place = nibabel.affines.apply_affine(image.affine, bright) * [-1, -1, 1]
    expected = breast_to_lps(plate_to_breast(volume.to_world(np.array([3, 1, 2])), 40.0), laterality)
    np.testing.assert_allclose(place, expected, atol=1e-4)
    readme = (out / "README.txt").read_text()
    assert "The breast lies where the pose has its plates" in readme
    assert "deformed.vtu: nodes, LPS (mm)" in readme


def test_images_are_exported_as_pictures_and_the_rest_is_named(tmp_path, capsys):
    pressed_artefact(tmp_path / "solve.h5", "R")
    assert main(["export", str(tmp_path / "solve.h5"), "--to", str(tmp_path / "out")]) == 0
    with Image.open(tmp_path / "out" / "projection.tiff") as picture:
        np.testing.assert_allclose(np.asarray(picture), np.linspace(0.0, 2.5, 120).reshape(10, 12), atol=1e-6)
    with Image.open(tmp_path / "out" / "mask.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), 255 * np.eye(12)[:10])
    assert not list((tmp_path / "out").glob("*projection*.csv"))
    assert "not written: contact/anchor: an array of 4 dimensions" in capsys.readouterr().err


def test_what_a_second_volume_places_is_refused_with_the_reason(tmp_path, capsys):
    pressed_artefact(tmp_path / "solve.h5", "R", view="3D")
    assert main(["export", str(tmp_path / "solve.h5"), "--to", str(tmp_path / "out")]) == 0
    error = capsys.readouterr().err
    for name in ("deformed", "surface", "updated/mr"):
        assert f"not written: {name}: `localize` alone places it" in error
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["README.txt", "mask.png", "projection.tiff"]


def test_an_artefact_with_nothing_to_export_says_so(tmp_path, capsys):
    write_artefact(tmp_path / "report.h5", ATTRS | {"stage": "report"}, Fields(values={"cases": 7}))
    assert main(["export", str(tmp_path / "report.h5"), "--to", str(tmp_path / "out")]) == 1
    assert "report.h5 holds nothing that can be exported" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_check_recognises_swapped_tables(tmp_path, capsys):
    folder = write_cohort(tmp_path)
    assert main(["check", str(folder / "views.tsv"), str(folder / "cases.tsv")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert "cases.tsv: these tables are swapped; give the table of the breasts first" in lines[1]
    assert main(["check", str(folder / "views.tsv")]) == 1
    assert "views.tsv: is given as cases, but is the table of the mammograms" in capsys.readouterr().err


def test_check_warns_of_marks_that_predict_nothing(tmp_path, capsys):
    folder = write_cohort(tmp_path)
    assert main(["check", str(folder / "cases.tsv")]) == 0
    assert (
        "warning: cases.tsv (c1): has mr_lesion and mr_landmarks but no view, so that nothing is predicted"
        in capsys.readouterr().out
    )


def test_check_of_a_good_and_a_bad_cohort(tmp_path, capsys):
    folder = write_cohort(tmp_path)
    assert main(["check", str(folder / "cases.tsv"), str(folder / "views.tsv")]) == 0
    assert capsys.readouterr().out == "1 cases and 1 mammograms, nothing to mend\n"
    (folder / "mr.nii.gz").unlink()
    assert main(["check", str(folder / "cases.tsv"), str(folder / "views.tsv")]) == 1
    assert (
        "1 fault found before the first job:\n  1. cases.tsv (c1), column mr: there is no file"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "no.h5"], "there is no file no.h5"),
        (["show", "README.md"], "README.md: is no artefact of this pipeline\n"),
        (["show", "folder"], "folder: is a folder, no artefact of this pipeline"),
        (["export", "no.h5", "--to", "out"], "there is no file no.h5"),
        (
            ["run", "segment", "--in", "mr=nothere.nii", "--out", "x.h5"],
            "segment, input mr: there is no file nothere.nii",
        ),
        (["run", "mash", "--out", "x.h5"], "no stage 'mash'; the stages are digital, segment"),
        (["run", "mesh", "--in", "segment", "--out", "x.h5"], "'segment' is no pair; write name=value"),
        (["run", "mesh", "--settings", "{elements: 7}", "--out", "x.h5"], "--settings is no JSON object"),
    ],
)
def test_mistake_is_one_message(arguments, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "README.md").write_text("a text of the user's\n")
    (tmp_path / "folder").mkdir()
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert "delete" not in error


def test_no_command_is_the_help_and_status_2(capsys):
    assert main([]) == 2
    assert "show artefacts" in capsys.readouterr().err


def test_show_prints_predictions_as_a_table_with_rounded_numbers(tmp_path, capsys):
    rows = [
        {"view": "CC", "name": "lesion", "column": -43.6057097, "row": 1234.5678, "message": ""},
        {"view": "MLO", "name": "a longer name", "column": None, "row": 7.0, "message": "not seen"},
    ]
    write_artefact(tmp_path / "localize.h5", ATTRS, Fields(values={"mammogram_rows": rows}))
    assert main(["show", str(tmp_path / "localize.h5")]) == 0
    lines = capsys.readouterr().out.splitlines()
    start = lines.index("  mammogram_rows, 2 rows")
    assert lines[start + 1 : start + 4] == [
        "    view  name           column   row  message",
        "    CC    lesion         -43.61  1235  -",
        "    MLO   a longer name       -     7  not seen",
    ]


def test_show_of_the_cohort_names_no_side(tmp_path, capsys):
    write_artefact(tmp_path / "calibrate.h5", ATTRS | {"stage": "calibrate", "case": "cohort", "view": ""}, Fields())
    assert main(["show", str(tmp_path / "calibrate.h5")]) == 0
    assert capsys.readouterr().out.startswith("calibrate of the cohort: ok\n")
