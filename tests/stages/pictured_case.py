"""The synthetic case of `synthetic_case` with images, lesions and landmarks, as far as stage `evaluate`."""

import csv
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
from PIL import Image

from mammoreg.geometry import breast_to_lps
from mammoreg.geometry.frames import Laterality
from stages.engine.artefact import Array, Artefact, Fields, VolumeField, write_artefact
from stages.engine.contract import Subject
from stages.engine.run import run_stage
from tests.stages import synthetic_case as synthetic

LESION = np.array([8.0, -45.0, 6.0])
LESION_DIAMETER_MM = 9.0
LANDMARKS = {"a": np.array([0.0, -30.0, 5.0]), "b": np.array([-12.0, -50.0, -10.0])}
FLIPS = (True, False)


def write_pictured_case(
    folder: Path, laterality: Laterality = "R", views: tuple[str, ...] = ("CC", "MLO"), outlined: bool = True
) -> dict[str, Any]:
    """Inputs of stage `figures` by name; the predictions are exact, since truth and model are the same affine map.

    A view 3D without an outline is a case that has its share of compression alone.
    """
    compressed = "3D" in views and outlined
    inputs: dict[str, Any] = synthetic.write_case(folder, laterality, views, FLIPS, compressed, outlined)
    _add_volumes(inputs["segment"][0])
    inputs["mr"] = _write_mr(folder / "mr.nii.gz")
    imaged = [pose for pose in inputs["pose"] if "3D" not in pose.name]
    for pose in imaged:
        _add_images(pose)
    inputs["project"] = [_run("project", folder, inputs, laterality, view) for view in views]
    inputs |= _write_marks(folder, laterality, [v for v in views if v != "3D"], compressed)
    for stage in ("localize", "evaluate"):
        inputs[stage] = [_run(stage, folder, inputs, laterality, None)]
    return inputs


def run_figures(folder: Path, inputs: dict[str, Any], laterality: Laterality = "R") -> Artefact:
    """The artefact of stage `figures`."""
    return Artefact(_run("figures", folder, inputs, laterality, None))


def run_per_case(stage: str, folder: Path, inputs: dict[str, Any], laterality: Laterality = "R") -> Path:
    """Run a stage of the case once more, with changed inputs."""
    return _run(stage, folder, inputs, laterality, None)


def _run(stage: str, folder: Path, inputs: dict[str, Any], laterality: Laterality, view: str | None) -> Path:
    from stages.engine.registry import load_stage

    record = load_stage(stage)
    given = {name: inputs[name] for name in (*record.inputs, *record.optional) if name in inputs}
    if view is not None:
        per_view = ("pose", "compress", "solve", "project")
        given |= {n: [p for p in given[n] if f".{view}." in p.name] for n in per_view if n in given}
    output = folder / (f"{stage}.{view}.h5" if view else f"{stage}.h5")
    run_stage(stage, given, output, {}, Subject("case1", laterality, view))
    return output


def _rewrite(path: Path, arrays: dict[str, Array], volumes: dict[str, VolumeField]) -> None:
    old = Artefact(path)
    kept = {n: Array(old.array(n, t["units"]), t["units"], t["long_name"]) for n, _, t in old.listing("arrays")}
    grids = {name: VolumeField(old.volume(name), "1", name) for name in old.volume_names()}
    values = {name: old.value(name) for name in old.value_names()}
    attrs = {key: text for key, text in old.attrs.items() if key not in ("status", "message")}
    write_artefact(path, attrs, Fields(kept | arrays, grids | volumes, values))


def _add_volumes(path: Path) -> None:
    breast = Artefact(path).volume("breast_mask")
    inside = breast.data != 0
    gland = inside & (np.indices(breast.shape)[2] % 8 < 4)
    labels = breast.with_data((inside.astype(np.uint8) + gland).astype(np.uint8))
    mr = breast.with_data((100.0 * labels.data + 20.0 * inside).astype(np.float32))
    _rewrite(path, {}, {"mr": VolumeField(mr, "1", "MR"), "labels": VolumeField(labels, "1", "tissue")})


MR_SHAPE = (90, 75, 80)
MR_AFFINE = np.array([[0.2, -1.5, 0, 60], [-1.4, -0.2, 0, 90], [0, 0, 1.6, -65], [0, 0, 0, 1]])


def _write_mr(path: Path) -> Path:
    """A volume with turned axes, of which only the grid matters; the affine is NIfTI's, to RAS."""
    nibabel.Nifti1Image(np.zeros(MR_SHAPE, dtype=np.int16), MR_AFFINE).to_filename(path)
    return path


def _add_images(path: Path) -> None:
    rows, columns = np.mgrid[: synthetic.ROWS, : synthetic.COLUMNS]
    breast = ((rows - 350) / 280) ** 2 + (columns / 340) ** 2 < 1
    image = np.where(breast, 1.0 + 0.2 * np.sin(rows / 30), 0.0).astype(np.float32)
    arrays = {
        "mammogram": Array(image, "1", "attenuation"),
        "breast_mask": Array(breast.astype(np.uint8), "1", "breast"),
    }
    _rewrite(path, arrays, {})


def _write_marks(folder: Path, laterality: Laterality, views: list[str], compressed: bool) -> dict[str, Path]:
    marks = {name: breast_to_lps(point, laterality) for name, point in LANDMARKS.items()}
    lesion = breast_to_lps(LESION, laterality)
    files = {
        "mr_landmarks": _table(folder / "mr.tsv", "name x y z", [[n, *p] for n, p in marks.items()]),
        "mr_lesion": _table(folder / "lesion.tsv", "name x y z diameter_mm", [["lesion", *lesion, LESION_DIAMETER_MM]]),
    }
    for view in views:
        places = {n: synthetic.stored(synthetic.true_pixel(view, p), FLIPS) for n, p in LANDMARKS.items()}
        files[f"landmarks_{view}"] = _table(
            folder / f"{view}.tsv", "name column row", [[n, *p] for n, p in places.items()]
        )
        files[f"lesion_{view}"] = folder / f"{view}.png"
        column, row = synthetic.stored(synthetic.true_pixel(view, LESION), FLIPS)
        rows, columns = np.mgrid[: synthetic.ROWS, : synthetic.COLUMNS]
        Image.fromarray((np.hypot(rows - row, columns - column) < 18).astype(np.uint8) * 255).save(
            files[f"lesion_{view}"]
        )
    if not views and compressed:
        files["mr_compressed_landmarks"] = files["mr_landmarks"]
    return files


def _table(path: Path, header: str, rows: list[list[Any]]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, delimiter="\t").writerows([header.split(), *rows])
    return path


def world_centroid(path: Path) -> np.ndarray:
    """Centroid of a NIfTI mask in LPS mm."""
    image = nibabel.load(path)
    voxels = np.argwhere(np.asarray(image.dataobj) > 0)
    return (nibabel.affines.apply_affine(image.affine, voxels).mean(axis=0)) * [-1, -1, 1]
