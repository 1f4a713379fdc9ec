"""Markups of 3D Slicer: their frames, units and shapes."""

import json
from pathlib import Path

import numpy as np
import pytest

from mammoreg.errors import DataError
from stages.cohort.readers.marks.points import read_points, read_spheres, without_diameter

COLUMNS = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"


def _fcsv(path: Path, system: str, *points: str) -> Path:
    lines = ["# Markups fiducial file version = 5.6", f"# CoordinateSystem = {system}", f"# columns = {COLUMNS}"]
    path.write_text("\n".join([*(line for line in lines if system or "System" not in line), *points]) + "\n")
    return path


def _json(path: Path, points: list[dict], **node: object) -> Path:
    markup = {"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": points} | node
    path.write_text(json.dumps({"markups": [{key: value for key, value in markup.items() if value is not None}]}))
    return path


def _points(*positions: tuple[float, ...], **more: object) -> list[dict]:
    return [{"label": f"F-{n}", "position": list(p)} | more for n, p in enumerate(positions, start=1)]


@pytest.mark.parametrize(
    ("system", "expected"), [("LPS", [1, 2, 3]), ("1", [1, 2, 3]), ("RAS", [-1, -2, 3]), ("0", [-1, -2, 3])]
)
def test_points_of_fcsv_come_in_lps(tmp_path, system, expected):
    path = _fcsv(tmp_path / "F.fcsv", system, '1,1,2,3,0,0,0,1,1,1,0,"mass, upper",12 mm,')
    np.testing.assert_allclose(read_points(path)["mass, upper"], expected)
    centre, diameter = read_spheres(path)["mass, upper"]
    np.testing.assert_allclose([*centre, diameter], [*expected, 12.0])


@pytest.mark.parametrize(("system", "says"), [("", "declares no coordinate"), ("2", "declares the coordinate system")])
def test_fcsv_without_a_frame(tmp_path, system, says):
    with pytest.raises(DataError, match=f"{says}.*LPS or RAS"):
        read_points(_fcsv(tmp_path / "F.fcsv", system, "1,1,2,3,0,0,0,1,1,1,0,F-1,,"))


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ({}, [1, 2, 3]),
        ({"coordinateSystem": "RAS"}, [-1, -2, 3]),
        ({"coordinateUnits": ["cm", "UCUM", "centimeter"]}, [10, 20, 30]),
        ({"coordinateUnits": None}, [1, 2, 3]),
    ],
)
def test_points_of_json_come_in_lps_and_mm(tmp_path, node, expected):
    found = read_points(_json(tmp_path / "F.mrk.json", _points((1, 2, 3), (4, 5, 6)), **node))
    assert list(found) == ["F-1", "F-2"]
    np.testing.assert_allclose(found["F-1"], expected)


def test_points_that_are_not_placed_are_left_out(tmp_path):
    points = [*_points((1, 2, 3)), {"label": "F-2", "position": [0, 0, 0], "positionStatus": "undefined"}]
    assert list(read_points(_json(tmp_path / "F.mrk.json", points))) == ["F-1"]


@pytest.mark.parametrize(
    ("points", "node", "says"),
    [
        (_points((1, 2, 3)), {"coordinateSystem": None}, "declares no coordinate system; say in which frame"),
        (_points((1, 2, 3)), {"coordinateUnits": "inch"}, "gives coordinates in 'inch'"),
        (_points((1, 2)), {}, "are no three numbers"),
        (_points((1, 2, 3)) * 2, {}, "name 'F-1' is given twice"),
        ([], {}, "marks nothing"),
        (_points((1, 2, 3), (2, 3, 4)), {"type": "Line"}, "holds a line, curve or box, not points"),
        (_points((1, 2, 3), (2, 3, 4)), {"type": "Angle"}, "type angle with 2 points"),
    ],
)
def test_bad_markups_say_what(tmp_path, points, node, says):
    with pytest.raises(DataError, match=says):
        read_points(_json(tmp_path / "F.mrk.json", points, **node))


def test_no_markups_at_all(tmp_path):
    (tmp_path / "F.mrk.json").write_text('{"points": []}')
    with pytest.raises(DataError, match="no markups file of 3D Slicer"):
        read_points(tmp_path / "F.mrk.json")


def test_a_line_is_the_lesions_diameter(tmp_path):
    path = _json(tmp_path / "L.mrk.json", _points((10, 0, 0), (10, 6, 8)), type="Line", coordinateSystem="RAS")
    centre, diameter = read_spheres(path)["lesion"]
    np.testing.assert_allclose([*centre, diameter], [-10, -3, 4, 10])


def test_a_closed_curve_is_its_outline(tmp_path):
    """A circle sampled unevenly has the circle's centre and diameter."""
    angles = np.deg2rad(np.concatenate([np.arange(0, 180, 2), np.arange(180, 360, 20)]))
    circle = [(5 + 7 * np.cos(a), -3 + 7 * np.sin(a), 20.0) for a in angles]
    centre, diameter = read_spheres(_json(tmp_path / "C.mrk.json", _points(*circle), type="ClosedCurve"))["lesion"]
    np.testing.assert_allclose(centre, [5, -3, 20], atol=0.1)
    assert diameter == pytest.approx(14.0, abs=0.05)


def test_a_box_has_the_diameter_of_its_volume(tmp_path):
    path = _json(tmp_path / "R.mrk.json", [], type="ROI", name="mass", center=[1, 2, 3], size=[4, 8, 16])
    centre, diameter = read_spheres(path)["mass"]
    np.testing.assert_allclose([*centre, diameter], [1, 2, 3, 8])


def test_a_bare_point_gets_the_documented_diameter(tmp_path):
    path = _json(tmp_path / "F.mrk.json", _points((1, 2, 3)) + _points((4, 5, 6), label="b", description="7.5"))
    assert {name: d for name, (_, d) in read_spheres(path).items()} == {"F-1": 10.0, "b": 7.5}
    assert without_diameter(path) == ["F-1"]
