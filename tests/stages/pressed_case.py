"""A breast that the plates have really pressed: artefacts up to `mesh`, a mammogram as PNG, and the truth of both."""

from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import closing_plates, place_breast
from mammoreg.fem.plates.closing import ClosingOptions
from mammoreg.geometry import ViewGeometry, Volume, breast_to_plate
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import MeshDeformation, ReferenceMesh
from mammoreg.materials.attenuation import attenuation_map
from mammoreg.meshing.locate import Locator
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.silhouette import detector_mm, quad_edges, ray_angles, silhouette
from mammoreg.projection.cone_beam import project_volume
from stages.engine.artefact import Artefact, Fields, write_artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from stages.mesh.record import mesh_fields
from stages.pose.record import ImageOutline, PoseFields
from stages.segment.record import segment_fields
from tests.stages.synthetic_case import header
from tests.unit.block_meshes import half_ellipsoid

ANGLE, EDGE, GAP, MIDDLE, MU = 5.0, -8.0, 58.0, 3.0, 9.4
ROWS, COLUMNS, PIXEL_MM = 420, 220, 0.5
GLAND = np.array([[14.0, -35.0, 27.0], [-18.0, -42.0, -27.0], [-8.0, -52.0, 22.0], [20.0, -50.0, -20.0]])
ROW = {"pixel_spacing_mm": str(PIXEL_MM), "thickness_mm": str(GAP), "angle_deg": "0", "orientation": "P\\L"}
GRID = Volume(np.zeros((70, 48, 60), dtype=np.uint8), np.array([-69.0, -86.0, -59.0]), np.full(3, 2.0))
MESH = half_ellipsoid(4, (60.0, 78.0, 48.0))


@dataclass(frozen=True)
class Pressed:
    """The truth: nodes between the plates and the geometry of the image, plate frame."""

    nodes: np.ndarray
    view: ViewGeometry

    def back(self, points_plate: np.ndarray) -> np.ndarray:
        """Points (N, 3) of the plate frame in the undeformed breast; nan outside it."""
        return MeshDeformation(ReferenceMesh(MESH.points, MESH.hexes()), self.nodes).inverse(points_plate)


@cache
def pressed() -> Pressed:
    alike = BreastMechanics(material="homogeneous")
    breast = place_breast(MESH, ANGLE, alike, MU)
    closed = closing_plates(breast, EDGE, alike, ClosingOptions()).close(GAP)
    view = ViewGeometry(ANGLE, EDGE, MIDDLE, closed.height_mm, GAP, 650.0, 15.0, PIXEL_MM, ROWS, COLUMNS)
    return Pressed(closed.deformed, view)


def labels() -> Volume:
    """Fat with two balls of gland, breast frame."""
    points = GRID.to_world(np.stack(np.meshgrid(*map(np.arange, GRID.shape), indexing="ij"), axis=-1)).reshape(-1, 3)
    _, _, inside = Locator(MESH.points, MESH.hexes()).locate(points)
    return GRID.with_data((inside * _tissue(points)).reshape(GRID.shape).astype(np.uint8))


def _tissue(points: np.ndarray) -> np.ndarray:
    gland = np.linalg.norm(points[:, None] - GLAND, axis=2).min(axis=1) < 9.0
    return np.where(gland, 2, 1)


@cache
def canonical_pixels() -> np.ndarray:
    """The mammogram, canonical, uint16."""
    truth, spacing = pressed(), 1.8
    low, high = truth.nodes.min(axis=0) - 3.0, truth.nodes.max(axis=0) + 3.0
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    source = truth.back(grid.reshape(-1, 3))
    tissue = np.where(np.isfinite(source).all(axis=1), _tissue(np.nan_to_num(source)), 0)
    volume = Volume(attenuation_map(tissue).reshape(grid.shape[:3]), low, np.full(3, spacing))
    return np.clip(8000.0 * project_volume(volume, truth.view, 1), 0, 65535).astype(np.uint16)


def write_mammogram(path: Path, laterality: Laterality = "R") -> Path:
    """As a unit stores it: a right CC has the chest wall at the right edge, a left one at the left."""
    stored = canonical_pixels()[:, ::-1] if laterality == "R" else canonical_pixels()
    Image.fromarray(np.ascontiguousarray(stored)).save(path)
    return path


def write_start(
    folder: Path, laterality: Laterality = "R", compressed: bool = False, mu_kpa: float = MU
) -> dict[str, Path]:
    """Artefacts `segment`, `mesh` and `calibrate`."""
    folder.mkdir(parents=True, exist_ok=True)
    found = {name: folder / f"{name}.h5" for name in ("segment", "mesh", "calibrate")}
    tissue = labels()
    volumes = {"labels": tissue, "breast_mask": tissue.with_data((tissue.data > 0).astype(np.uint8))}
    if compressed:
        volumes["compressed_mask"] = second_mask()
    back, nipple = MESH.points[MESH.back_nodes()], np.array([0.0, -78.0, 0.0])
    segment = segment_fields(volumes, back, nipple, laterality, {})
    write_artefact(found["segment"], header("segment", laterality), segment)
    write_artefact(found["mesh"], header("mesh", laterality), mesh_fields(MESH, laterality, {}))
    write_artefact(found["calibrate"], header("calibrate", "R"), Fields(values={"mu_kpa": mu_kpa}))
    return found


def second_mask() -> Volume:
    """The pressed breast with a chest behind it, breast frame, as a mask of a second MR volume."""
    spacing, low, shape = 1.6, np.array([-85.0, -100.0, -75.0]), (107, 83, 95)
    grid = low + spacing * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    turned, nodes = breast_to_plate(grid, ANGLE), pressed().nodes
    body = grid[:, 1] > 5.0
    near = ~body & ((turned > nodes.min(axis=0)) & (turned < nodes.max(axis=0))).all(axis=1)
    body[near] = Locator(nodes, MESH.hexes()).locate(turned[near])[2]
    return Volume(body.reshape(shape).astype(np.uint8), low, np.full(3, spacing))


def write_pose(
    path: Path, wider_mm: float = 0.0, view: str = "CC", outlined: bool = True, plates_known: bool = False, **changes
) -> Path:
    """The true pose, `changes` aside, with the true outline moved outwards at the middle of the plates."""
    truth = pressed()
    placed = {name: value for name, value in changes.items() if name in {f.name for f in fields(ViewGeometry)}}
    pose = PoseFields(
        view=replace(truth.view, **placed),
        rigid=truth.view,
        maps={},
        outline=ImageOutline(*_outline(truth, wider_mm)) if outlined else None,
        plates_known=plates_known,
        values={name: value for name, value in changes.items() if name not in placed},
    )
    write_artefact(path, header("pose", "R", view), pose.fields())
    return path


def _outline(truth: Pressed, wider_mm: float) -> tuple[np.ndarray, np.ndarray]:
    facets = skin_facets(MESH.skin_quads(), len(MESH.points), 3)
    flat = detector_mm(facets.positions(truth.nodes), truth.view)
    points = silhouette(flat, quad_edges(facets.quads), 0.0, ray_angles(361)).points()
    points = points[np.isfinite(points).all(axis=1)]
    tangent = np.gradient(points, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    weight = np.clip(points[:, 0] / 10.0, 0.0, 1.0)
    moved = (points + wider_mm * truth.view.middle_magnification * normal) / PIXEL_MM
    return np.stack([moved[:, 0] - 0.5, moved[:, 1] + 0.5 * (ROWS - 1)], axis=-1), weight


def run(stage: str, folder: Path, inputs: dict[str, Path], settings=None, view: str = "CC", row=None, side="R"):
    """Run a stage of one view on artefacts by name; the artefact's name tells the settings apart."""
    folder.mkdir(parents=True, exist_ok=True)
    output = folder / f"{stage}.{view}.{len(list(folder.iterdir()))}.h5"
    settings = settings or {}
    if stage == "compress":  # the truth's tissue, unless a test says otherwise
        settings = settings | {"mechanics": {"material": "homogeneous"} | settings.get("mechanics", {})}
    run_stage(stage, inputs, output, settings, Subject("case1", side, view, row or {}))
    return Artefact(output)
