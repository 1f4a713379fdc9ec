"""A synthetic breast whose compression is affine, as the artefacts of the stages before `localize` hold it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from mammoreg.geometry import ViewGeometry, Volume
from mammoreg.geometry.frames import Laterality, plate_rotation
from mammoreg.localization.deformation import AffineDeformation
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Array, Fields, write_artefact
from stages.engine.failures import Failure
from stages.mesh.record import mesh_fields
from stages.pose.record import ImageOutline, ImageStorage, PoseFields
from stages.segment.record import segment_fields

SHRINK = 0.7
ROWS, COLUMNS, PIXEL_MM = 700, 400, 0.25
HALF_WIDTH, DEPTH = 45.0, 70.0


def box() -> BlockMesh:
    """A box-shaped breast, breast frame."""
    n = 5
    axis = np.linspace(0, 1, n + 1)
    k, j, i = np.meshgrid(axis, axis, axis, indexing="ij")
    points = [(2 * i - 1) * HALF_WIDTH, -k * DEPTH, (2 * j - 1) * HALF_WIDTH]
    return BlockMesh(n, np.stack(points, axis=-1).reshape(-1, 3))


def geometry(view: str, parallel: bool = False) -> ViewGeometry:
    angle = {"CC": 3.0, "MLO": 48.0, "3D": 3.0}[view]
    return ViewGeometry(angle, -5.0, 2.0, -40.0, 80.0, 650.0, 15.0, PIXEL_MM, ROWS, COLUMNS, parallel)


def compression(view: str) -> AffineDeformation:
    wide = SHRINK**-0.5
    return AffineDeformation(np.diag([wide, wide, SHRINK]) @ plate_rotation(geometry(view).angle_deg), np.zeros(3))


def turning(view: str) -> AffineDeformation:
    return AffineDeformation(plate_rotation(geometry(view).angle_deg), np.zeros(3))


def header(stage: str, laterality: Laterality, view: str = "") -> dict[str, str]:
    return {"stage": stage, "case": "case1", "view": view, "laterality": laterality, "artefact_id": f"{stage}{view}"}


def write_segment(path: Path, laterality: Laterality, compressed: bool = False, warnings: tuple[str, ...] = ()) -> Path:
    spacing, n = np.full(3, 2.0), (56, 44, 56)
    origin = np.array([-55.0, -75.0, -55.0])
    grid = np.stack(
        np.meshgrid(*(o + s * np.arange(k) for o, s, k in zip(origin, spacing, n, strict=True)), indexing="ij"), axis=-1
    )
    inside = (np.abs(grid[..., [0, 2]]) < HALF_WIDTH).all(-1) & (grid[..., 1] < 0) & (grid[..., 1] > -DEPTH)
    labels = np.where(grid[..., 1] < 0, inside, 4)
    volumes = {
        "breast_mask": Volume(inside.astype(np.uint8), origin, spacing),
        "labels": Volume(labels.astype(np.uint8), origin, spacing),
    }
    side = np.linspace(-HALF_WIDTH, HALF_WIDTH, 31)
    wall = np.stack([*np.meshgrid(side, side, indexing="ij"), np.zeros((31, 31))], axis=-1).reshape(-1, 3)[:, [0, 2, 1]]
    if compressed:
        volumes["compressed_mask"] = _compressed_mask()
    fields = segment_fields(volumes, wall, np.array([0.0, -DEPTH, 0.0]), laterality, {"warnings": list(warnings)})
    write_artefact(path, header("segment", laterality), fields)
    return path


SECOND_VOLUME_SHIFT = np.array([4.0, -3.0, 6.0])


def _compressed_mask() -> Volume:
    """The body between the plates of the CC, shifted by `SECOND_VOLUME_SHIFT`, with a chest behind."""
    axis = np.arange(-90.0, 91.0, 2.0)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) - SECOND_VOLUME_SHIFT
    back = compression("CC").inverse(grid @ plate_rotation(geometry("CC").angle_deg).T)
    body = (np.abs(back[:, [0, 2]]) < HALF_WIDTH).all(-1) & (back[:, 1] > -DEPTH) | (back[:, 1] > 0)
    data = body.reshape(len(axis), len(axis), len(axis)).astype(np.uint8)
    return Volume(data, np.full(3, -90.0), np.full(3, 2.0))


def write_mesh(path: Path, laterality: Laterality) -> Path:
    write_artefact(path, header("mesh", laterality), mesh_fields(box(), laterality, {}))
    return path


def write_pose(
    path: Path,
    laterality: Laterality,
    view: str,
    flips: tuple[bool, bool],
    outlined: bool,
    flags: Sequence[str] = (),
    values: dict[str, Any] | None = None,
) -> Path:
    found = PoseFields(
        view=geometry(view),
        rigid=geometry(view),
        maps={"rigid": turning(view), "scaling": compression(view)},
        outline=ImageOutline(_outline(view), np.ones(len(_outline(view)))) if outlined else None,
        storage=ImageStorage(ROWS, COLUMNS, *flips),
        drawn_mm=(0.0, 0.0, 0.0),
        estimated=("source_detector_mm",),
        flags=flags,
        values=values or {},
    )
    write_artefact(path, header("pose", laterality, view), found.fields())
    return path


def _outline(view: str) -> np.ndarray:
    """Outline of the projected box, a convex polygon, from the chest wall round the front and back to it."""
    corners = geometry(view, parallel=view == "3D").project(compression(view).forward(box().points))
    polygon = corners[ConvexHull(corners).vertices]
    gaps = np.where(polygon[:, 0] < 0, polygon[:, 0] + np.roll(polygon[:, 0], -1), np.inf)
    return np.roll(polygon, -1 - int(np.argmin(gaps)), axis=0)


def write_solution(
    path: Path, laterality: Laterality, stage: str, view: str, changes: dict[str, Any] | None = None
) -> Path:
    arrays = {"deformed": Array(compression(view).forward(box().points), "mm", "nodes between the plates")}
    values = {"force_lower_n": 79.0, "force_upper_n": 81.0, "min_det_f": 0.9, "thickness_mm": 80.0, **(changes or {})}
    write_artefact(path, header(stage, laterality, view), Fields(arrays=arrays, values=values))
    return path


def write_failed(path: Path, laterality: Laterality, stage: str, view: str = "", message: str = "went wrong") -> Path:
    write_artefact(path, header(stage, laterality, view), Fields(failure=Failure(stage, view, "failed", message)))
    return path


def write_case(
    folder: Path,
    laterality: Laterality = "R",
    views: tuple[str, ...] = ("CC", "MLO"),
    flips: tuple[bool, bool] = (False, False),
    compressed: bool = False,
    outlined: bool = True,
) -> dict[str, list[Path]]:
    """All artefacts before `localize`, as inputs by name."""
    folder.mkdir(parents=True, exist_ok=True)
    inputs = {
        "segment": [write_segment(folder / "segment.h5", laterality, compressed)],
        "mesh": [write_mesh(folder / "mesh.h5", laterality)],
        "pose": [write_pose(folder / f"pose.{v}.h5", laterality, v, flips, outlined) for v in views],
    }
    for stage in ("compress", "solve"):
        inputs[stage] = [write_solution(folder / f"{stage}.{v}.h5", laterality, stage, v) for v in views]
    return inputs


def true_pixel(view: str, point: np.ndarray) -> np.ndarray:
    """Canonical pixel (column, row) of a point of the undeformed breast, breast frame."""
    return geometry(view).project(compression(view).forward(point[None]))[0]


def stored(pixel: np.ndarray, flips: tuple[bool, bool]) -> np.ndarray:
    column, row = pixel
    return np.array([COLUMNS - 1 - column if flips[1] else column, ROWS - 1 - row if flips[0] else row])
