"""Lesion polygons of MIMBCD-UI's `dataset-uta11-findings` as marks of an imported cohort.

    mammoreg import dataset-uta11-dicom/dataset my_cohort --with-paths
    python examples/uta11_marks.py dataset-uta11-dicom/dataset my_cohort dataset-uta11-findings

Each JSON file lists the polygons of one study by stack. A stack names its images by a digest of their identifiers; the
images are looked for in the export, so that a polygon on a slice of any MR series finds its place in the patient.
Written are, in `my_cohort/marks`, a table `name x y z diameter_mm` (LPS, mm) for each breast and one
`name column row diameter_mm` for each mammogram, and the columns `mr_lesion` and `lesion` of the two tables.
"""

import argparse
import csv
import hashlib
import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.typing import NDArray

PIXEL_CENTRE = 0.5
"""The viewer's (0, 0) is the corner of the first pixel, ours its centre."""
JOINED_MM = 5.0
"""Polygons on slices that lie nearer to each other than this outline one lesion."""


@dataclass(frozen=True)
class Polygon:
    """A polygon of a reader's.

    Attributes:
        image: digest that names the image.
        modality: MR, MG or US, as the stack says.
        points: corners (N, 2) as (column, row), pixel centres.
    """

    image: str
    modality: str
    points: NDArray[np.float64]

    @property
    def area(self) -> float:
        """Enclosed area, square pixels."""
        x, y = self.points.T
        return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)

    @property
    def centre(self) -> NDArray[np.float64]:
        """Centroid (2,) of the enclosed area, pixels."""
        x, y = (self.points - self.points.mean(axis=0)).T
        cross = x * np.roll(y, -1) - np.roll(x, -1) * y
        if abs(cross.sum()) < 1e-9:
            return np.asarray(self.points.mean(axis=0))
        moments = [((axis + np.roll(axis, -1)) @ cross) / (3.0 * cross.sum()) for axis in (x, y)]
        return np.asarray(self.points.mean(axis=0) + moments)


@dataclass(frozen=True)
class Ball:
    """A lesion in MR: centre (3,), LPS mm, and diameter, mm."""

    centre: NDArray[np.float64]
    diameter_mm: float


def polygons_of(findings: Mapping[str, Any]) -> Iterator[Polygon]:
    """The polygons of one JSON file; what has no area is left out."""
    for stack in findings["rawData"]["stacks"]:
        images = [address.rstrip("/").split("/")[-2] for address in stack["imageIds"]]
        drawn = stack.get("freehand") or []
        places = stack["currentImageIdIndex"] if len(images) > 1 else [0] * len(drawn)
        for index, polygon in zip(places, drawn, strict=False):
            points = np.array([[handle["x"], handle["y"]] for handle in polygon["handles"]], dtype=float)
            found = Polygon(images[index], stack["seriesDescription"], points.reshape(-1, 2) - PIXEL_CENTRE)
            if found.area > 0.0:
                yield found


def image_name(header: pydicom.Dataset) -> str:
    """The name under which the findings know an image."""
    keywords = ("PatientID", "StudyInstanceUID", "SeriesInstanceUID", "SOPInstanceUID")
    digest = hashlib.sha1("|".join(str(header.get(keyword, "")) for keyword in keywords).encode()).hexdigest()
    return "-".join(digest[start : start + 8] for start in range(0, 40, 8))


def ball_of(polygon: Polygon, header: pydicom.Dataset) -> Ball:
    """A polygon on an MR slice, as the ball whose great circle has its area."""
    rows_mm, columns_mm = (float(value) for value in header.PixelSpacing)
    along_row, along_column = np.array(header.ImageOrientationPatient, dtype=float).reshape(2, 3)
    column, row = polygon.centre
    corner = np.array(header.ImagePositionPatient, dtype=float)
    centre = corner + column * columns_mm * along_row + row * rows_mm * along_column
    return Ball(centre, 2.0 * float(np.sqrt(polygon.area * rows_mm * columns_mm / np.pi)))


def joined(balls: Sequence[Ball]) -> list[Ball]:
    """Lesions of balls that touch or nearly so: their centre by area, as wide as their largest or as they reach."""
    groups: list[list[Ball]] = []
    for ball in balls:
        near = [group for group in groups if any(_gap_mm(ball, other) < JOINED_MM for other in group)]
        groups = [group for group in groups if not any(group is one for one in near)]
        groups.append([ball, *(other for group in near for other in group)])
    return sorted((_joined(group) for group in groups), key=lambda ball: -ball.diameter_mm)


def _gap_mm(one: Ball, other: Ball) -> float:
    return float(np.linalg.norm(one.centre - other.centre)) - (one.diameter_mm + other.diameter_mm) / 2.0


def _joined(group: Sequence[Ball]) -> Ball:
    centres, widths = np.array([ball.centre for ball in group]), np.array([ball.diameter_mm for ball in group])
    centre = np.average(centres, axis=0, weights=widths**2)
    reach = max(float(np.linalg.norm(a - b)) for a in centres for b in centres)
    return Ball(centre, max(float(widths.max()), reach))


def headers_of(export: Path) -> Iterator[tuple[Path, pydicom.Dataset]]:
    """The header of each DICOM image of a folder."""
    for path in sorted(p for p in export.rglob("*") if p.is_file()):
        try:
            header = pydicom.dcmread(path, stop_before_pixels=True)
        except (pydicom.errors.InvalidDicomError, OSError, EOFError):
            continue
        if "Rows" in header:
            yield path, header


@dataclass(frozen=True)
class Imported:
    """What `import.tsv` says, by the files' absolute names.

    Attributes:
        volumes: cases for which an MR file is used.
        images: case and view for which a mammogram is used.
    """

    volumes: Mapping[Path, Sequence[str]]
    images: Mapping[Path, tuple[str, str]]


def imported(cohort: Path) -> Imported:
    """Read the account of `mammoreg import --with-paths`."""
    volumes: dict[Path, Sequence[str]] = {}
    images: dict[Path, tuple[str, str]] = {}
    rows = read_table(cohort / "import.tsv")
    if rows and "files" not in rows[0]:
        raise SystemExit(f"{cohort / 'import.tsv'}: names no files; import again with --with-paths")
    for row in (row for row in rows if row["used_for"]):
        for file in row["files"].split(" | "):
            path = Path(file).resolve()
            if row["what"].startswith("MR "):
                volumes[path] = row["used_for"].split()
            else:
                images[path] = (row["used_for"], row["what"].split(",")[0].split()[1])
    return Imported(volumes, images)


Disc = tuple[float, float, float]
"""Column, row, and diameter in mm of the breast."""


def marks_of(
    headers: Iterable[tuple[Path, pydicom.Dataset]], known: Imported, polygons: Iterable[Polygon]
) -> tuple[dict[str, list[Ball]], dict[tuple[str, str], list[Disc]]]:
    """Lesions in MR by case, and in mammograms by case and view."""
    wanted: dict[str, list[Polygon]] = defaultdict(list)
    for polygon in polygons:
        wanted[polygon.image].append(polygon)
    cases_of: dict[str, Sequence[str]] = {}
    drawn: list[tuple[Path, pydicom.Dataset, Polygon]] = []
    for path, header in headers:
        if path.resolve() in known.volumes:
            cases_of[header.StudyInstanceUID] = known.volumes[path.resolve()]
        drawn += [(path.resolve(), header, polygon) for polygon in wanted.pop(image_name(header), [])]
    for polygon in (polygon for left in wanted.values() for polygon in left if polygon.modality != "US"):
        print(f"left: a polygon on an image ({polygon.modality}) that is not in the export", file=sys.stderr)
    return _balls(drawn, cases_of), _discs(drawn, known)


Drawn = Sequence[tuple[Path, pydicom.Dataset, Polygon]]


def _balls(drawn: Drawn, cases_of: Mapping[str, Sequence[str]]) -> dict[str, list[Ball]]:
    found: dict[str, list[Ball]] = defaultdict(list)
    for _, header, polygon in (one for one in drawn if one[1].Modality == "MR"):
        ball = ball_of(polygon, header)
        cases = [case for case in cases_of.get(header.StudyInstanceUID, ()) if case.endswith(side_of(ball, header))]
        if not cases:
            print("left: a polygon in MR of a breast that the import did not take", file=sys.stderr)
        for case in cases:
            found[case].append(ball)
    return {case: joined(balls) for case, balls in found.items()}


def _discs(drawn: Drawn, known: Imported) -> dict[tuple[str, str], list[Disc]]:
    found: dict[tuple[str, str], list[Disc]] = defaultdict(list)
    for path, header, polygon in (one for one in drawn if one[1].Modality == "MG"):
        if path in known.images:
            found[known.images[path]].append(disc_of(polygon, header))
        else:
            print("left: a polygon on a mammogram that the import did not take", file=sys.stderr)
    return dict(found)


def disc_of(polygon: Polygon, header: pydicom.Dataset) -> Disc:
    """A polygon on a mammogram as the disc of its area."""
    at_detector = header.get("ImagerPixelSpacing")
    magnified = float(header.get("EstimatedRadiographicMagnificationFactor") or 1.0) if at_detector else 1.0
    pixel_mm = float((at_detector or header.PixelSpacing)[0]) / magnified
    diameter_mm = 2.0 * float(np.sqrt(polygon.area / np.pi)) * pixel_mm
    column, row = polygon.centre
    return float(column), float(row), diameter_mm


def side_of(ball: Ball, header: pydicom.Dataset) -> str:
    """The breast in which a mark lies: left of the slice's middle, or of the scanner's where slices are sagittal."""
    along_row, along_column = np.array(header.ImageOrientationPatient, dtype=float).reshape(2, 3)
    rows_mm, columns_mm = (float(value) for value in header.PixelSpacing)
    across = (header.Columns - 1) / 2.0 * columns_mm * along_row + (header.Rows - 1) / 2.0 * rows_mm * along_column
    sagittal = abs(np.cross(along_row, along_column)[0]) > 0.7
    middle = 0.0 if sagittal else float(header.ImagePositionPatient[0]) + float(across[0])
    return "L" if ball.centre[0] > middle else "R"


def read_table(path: Path) -> list[dict[str, str]]:
    """Rows of a tab-separated table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def write_table(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows; columns are those of any row."""
    with path.open("w", encoding="utf-8", newline="") as file:
        columns = list(dict.fromkeys(column for row in rows for column in row))
        writer = csv.DictWriter(file, columns, delimiter="\t", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def names(count: int, alone: bool, prefix: str) -> list[str]:
    """Names of a breast's marks; the same name in MR and mammogram, which means one lesion, only where each has one."""
    return ["lesion"] if alone else [f"{prefix}_{number}" for number in range(1, count + 1)]


def write_marks(
    cohort: Path, balls: Mapping[str, Sequence[Ball]], discs: Mapping[tuple[str, str], Sequence[Disc]]
) -> None:
    """Write the marks, and name them in both tables."""
    (cohort / "marks").mkdir(exist_ok=True)
    cases, views = read_table(cohort / "cases.tsv"), read_table(cohort / "views.tsv")
    for case in cases:
        mine = {view: found for (owner, view), found in discs.items() if owner == case["case"]}
        spheres = balls.get(case["case"], [])
        alone = all(len(found) <= 1 for found in (spheres, *mine.values()))
        balls_cells = [_cells("x y z diameter_mm", (*ball.centre, ball.diameter_mm)) for ball in spheres]
        if spheres:
            case["mr_lesion"] = f"marks/{case['case']}_mr.tsv"
            write_table(cohort / case["mr_lesion"], _named(balls_cells, alone, "mr"))
        for row in (row for row in views if row["case"] == case["case"] and row["view"] in mine):
            discs_cells = [_cells("column row diameter_mm", disc) for disc in mine[row["view"]]]
            row["lesion"] = f"marks/{row['case']}_{row['view']}.tsv"
            write_table(cohort / row["lesion"], _named(discs_cells, alone, row["view"].lower()))
    write_table(cohort / "cases.tsv", cases)
    write_table(cohort / "views.tsv", views)


def _named(rows: Sequence[Mapping[str, str]], alone: bool, prefix: str) -> list[dict[str, str]]:
    return [{"name": name} | dict(row) for name, row in zip(names(len(rows), alone, prefix), rows, strict=True)]


def _cells(columns: str, values: Sequence[float]) -> dict[str, str]:
    return {column: f"{value:.2f}" for column, value in zip(columns.split(), values, strict=True)}


def main(words: Sequence[str] | None = None) -> None:
    """Read the three folders and write the marks."""
    parser = argparse.ArgumentParser(description="Polygons of dataset-uta11-findings as marks of an imported cohort.")
    parser.add_argument("export", type=Path, help="the folder that was imported")
    parser.add_argument("cohort", type=Path, help="what `mammoreg import --with-paths` made of it")
    parser.add_argument("findings", type=Path, help="folder of the JSON files")
    given = parser.parse_args(words)
    read = (json.loads(path.read_text(encoding="utf-8")) for path in sorted(given.findings.rglob("*.json")))
    files = [found for found in read if isinstance(found, dict) and "rawData" in found]
    polygons = [polygon for found in files for polygon in polygons_of(found)]
    balls, discs = marks_of(headers_of(given.export), imported(given.cohort), polygons)
    write_marks(given.cohort, balls, discs)
    print(f"{len(polygons)} polygons of {len(files)} files")
    print(f"MR lesions in {len(balls)} breasts, marks on {len(discs)} mammograms: {given.cohort / 'marks'}")


if __name__ == "__main__":
    main()
