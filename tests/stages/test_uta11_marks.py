"""The example that turns MIMBCD-UI's polygons into marks: on a made-up export, and on two of its real files."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import nibabel
import numpy as np
import pytest
from pydicom import dcmread

from stages.cohort.cases import read_cohort
from stages.cohort.preflight import check_cohort
from stages.cohort.readers.marks.points import read_discs, read_spheres
from stages.command.main import main
from tests.shared_data import DATA, requires_shared
from tests.stages.mr_series import PIXEL_MM, series, write
from tests.stages.test_import import write_views

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def example() -> ModuleType:
    import sys

    spec = importlib.util.spec_from_file_location("uta11_marks", PROJECT / "examples" / "uta11_marks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["uta11_marks"] = module
    spec.loader.exec_module(module)
    return module


def circle(column: float, row: float, radius: float) -> dict:
    """A polygon as the viewer keeps it, whose (0, 0) is the corner of the first pixel."""
    angles = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    points = [(column + 0.5 + radius * np.cos(a), row + 0.5 + radius * np.sin(a)) for a in angles]
    return {"handles": [{"x": x, "y": y} for x, y in points]}


def stack(example: ModuleType, modality: str, headers: list, drawn: dict[int, list[dict]]) -> dict:
    polygons = [(index, polygon) for index, found in drawn.items() for polygon in found]
    return {
        "seriesDescription": modality,
        "imageIds": [f"wadouri://host/instances/{example.image_name(header)}/file" for header in headers],
        "currentImageIdIndex": [index for index, _ in polygons],
        "freehand": [polygon for _, polygon in polygons],
    }


def test_polygons_of_a_made_up_patient(example, tmp_path):
    """A lesion on two neighbouring slices and in both views of the right breast comes to its place and size."""
    export, cohort, findings = tmp_path / "export", tmp_path / "cohort", tmp_path / "findings"
    slices = series("t1", start=(-10.0, -8.0, 5.0))
    write(export / "MR", slices)
    write_views(export / "MG", "Doe^Jane", "RCC", "RMLO")
    assert main(["import", str(export), str(cohort), "--with-paths"]) == 0
    views = {image.ViewPosition: image for image in map(dcmread, sorted((export / "MG").iterdir()))}
    findings.mkdir()
    stacks = [
        stack(example, "MR", slices, {3: [circle(2.0, 6.0, 1.5)], 4: [circle(2.0, 6.0, 2.0)]}),
        stack(example, "MG", [views["CC"]], {0: [circle(11.0, 17.0, 5.0)]}),
        stack(example, "MG", [views["MLO"]], {0: [circle(9.0, 20.0, 4.0)]}),
        {
            "seriesDescription": "US",
            "imageIds": ["wadouri://host/instances/none/file"],
            "currentImageIdIndex": [0],
            "freehand": [circle(1.0, 1.0, 1.0)],
        },
    ]
    (findings / "a.json").write_text(json.dumps({"rawData": {"stacks": stacks}}))
    example.main([str(export), str(cohort), str(findings)])
    tables = read_cohort(cohort / "cases.tsv", cohort / "views.tsv")
    assert check_cohort(tables) == []
    ((name, (centre, diameter_mm)),) = read_spheres(tables.cases["p1R"].mr_lesion).items()
    assert name == "lesion"
    on_slices = np.array([[-10.0 + 2.0 * PIXEL_MM, -8.0 + 6.0 * PIXEL_MM, z] for z in (11.0, 13.0)])
    assert centre == pytest.approx(np.average(on_slices, axis=0, weights=[1.5**2, 2.0**2]), abs=0.02)
    assert diameter_mm == pytest.approx(2.0 * 2.0 * PIXEL_MM, rel=0.01)
    ((name, (pixel, diameter_mm)),) = read_discs(tables.mammograms["p1R", "CC"].lesion).items()
    assert name == "lesion"
    assert pixel == pytest.approx([11.0, 17.0], abs=0.02)
    assert diameter_mm == pytest.approx(2.0 * 5.0 * float(views["CC"].ImagerPixelSpacing[0]), rel=0.01)


def test_lesions_apart_have_names_of_their_own(example):
    """What may be different lesions gets no common name, which would say that they are the same."""
    far = [example.Ball(np.array([0.0, 0.0, z]), 6.0) for z in (0.0, 38.0)]
    near = [example.Ball(np.array([0.0, 0.0, z]), 6.0) for z in (0.0, 9.0)]
    assert len(example.joined(far)) == 2
    (one,) = example.joined(near)
    assert one.centre == pytest.approx([0.0, 0.0, 4.5])
    assert one.diameter_mm == 9.0
    assert set(example.names(2, False, "mr")) == {"mr_1", "mr_2"}
    assert not set(example.names(2, False, "mr")) & set(example.names(2, False, "cc"))


def findings(name: str) -> dict:
    return json.loads((DATA / "uta11_findings" / name).read_text(encoding="utf-8"))


@requires_shared("uta11_findings")
@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("43c8266d-c83e-40fc-a0dc-ac955a132c0e.json", {"MR": 2, "MG": 6, "US": 1}),
        ("be67e550-43eb-4739-83c7-5424db13c271.json", {"MR": 4, "MG": 1, "US": 1}),
    ],
)
def test_polygons_of_real_files(example, name, counts):
    polygons = list(example.polygons_of(findings(name)))
    found = {kind: sum(polygon.modality == kind for polygon in polygons) for kind in counts}
    assert found == counts
    for polygon in polygons:
        low, high = polygon.points.min(axis=0), polygon.points.max(axis=0)
        assert np.all((low < polygon.centre) & (polygon.centre < high))
        assert polygon.area <= float(np.prod(high - low))


@requires_shared("uta11_findings")
def test_a_real_lesion_shines_where_its_polygons_lie(example):
    """On the slices that the file names, in their order from below, the lesion is brighter than what lies around."""
    stacks = findings("be67e550-43eb-4739-83c7-5424db13c271.json")["rawData"]["stacks"]
    data = np.asarray(nibabel.load(DATA / "mri/34123afd_t1_fs_pre.nii.gz").dataobj)
    (mr,) = [one for one in stacks if one["seriesDescription"] == "MR"]
    assert len(mr["imageIds"]) == data.shape[2]
    polygons = list(example.polygons_of({"rawData": {"stacks": [mr]}}))
    shares = []
    for index, polygon in zip(mr["currentImageIdIndex"], polygons, strict=True):
        column, row = np.rint(polygon.centre).astype(int)
        inside = data[column - 2 : column + 3, row - 2 : row + 3, index].mean()
        shares.append(inside / data[column - 25 : column + 26, row - 25 : row + 26, index].mean())
    assert min(shares) > 1.4
