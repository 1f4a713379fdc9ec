"""Stage `localize`: where each side shows what the other marks. The three directions share no marks."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial

from mammoreg.errors import DataError
from mammoreg.geometry import lps_to_breast
from mammoreg.geometry.frames import Laterality, Points
from mammoreg.localization.deformation import ReferenceMesh
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact, Fields
from stages.engine.contract import Failure, Inputs, SettingsModel, Stage, Subject, Value
from stages.localize.to_compressed import missing_in_compressed, predict_in_compressed, second_volume
from stages.localize.to_mammogram import missing_in_mammograms, predict_in_mammograms
from stages.localize.to_mr import Anatomy, missing_in_mr, predict_in_mr
from stages.localize.views import CaseViews, case_views, lost_views
from stages.marks import mr_landmarks, mr_lesion_names, mr_lesions, view_areas, view_lesion_names
from stages.methods import block_mesh

_SKIN_PARTS = 6


class Settings(SettingsModel):
    """`localize` has no settings: what it predicts is bound by the contract."""


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Predict in every direction for which the case has marks; what a failed view lacks is a row with its message."""
    segment, mesh = inputs.artefact("segment"), inputs.artefact("mesh")
    if failure := segment.failure or mesh.failure:
        return Fields(values=without_result(inputs, failure), failure=failure)
    block = block_mesh(mesh)
    per_view = [a for name in ("pose", "compress", "solve") for a in inputs.artefacts(name)]
    poses = [a for a in per_view if a.stage == "pose"]
    solutions = [a for a in per_view if a.stage != "pose"]
    views = case_views(poses, solutions, ReferenceMesh(block.points, block.hexes()))
    parts = [
        _to_mammograms(inputs, views, segment.laterality),
        _to_mr(inputs, views, segment, block.skin_points(_SKIN_PARTS)),
        _to_compressed(inputs, views, segment, block),
    ]
    return _joined(parts, per_view)


def _to_mammograms(inputs: Inputs, views: CaseViews, laterality: Laterality) -> Fields:
    """Reads `mr_lesion` and `mr_landmarks` alone."""
    lesions = mr_lesions(inputs).items()
    bodies = {name: lesion.to_breast(laterality).body() for name, lesion in lesions}
    return predict_in_mammograms(views, bodies, _landmarks(inputs, laterality))


def _to_mr(inputs: Inputs, views: CaseViews, segment: Artefact, skin: Points) -> Fields:
    """Reads the views' `lesion` alone."""
    side = segment.laterality
    anatomy = Anatomy(
        side,
        segment.volume("breast_mask").to_breast(side),
        lps_to_breast(segment.array("nipple", "mm"), side),
        skin,
        lps_to_breast(segment.array("chest_wall_surface", "mm"), side),
    )
    names_of = {view: view_lesion_names(inputs, view) for view in views.imaged}
    return predict_in_mr(views, anatomy, names_of, {v: view_areas(inputs, pose) for v, pose in views.poses.items()})


def _to_compressed(inputs: Inputs, views: CaseViews, segment: Artefact, block: BlockMesh) -> Fields:
    """Reads `mr_landmarks` and the mask of the second volume alone."""
    second = second_volume(segment, block)
    if second is None:
        return Fields()
    return predict_in_compressed(views, second, _landmarks(inputs, segment.laterality), segment.laterality)


def _landmarks(inputs: Inputs, laterality: Laterality) -> dict[str, Points]:
    return {name: lps_to_breast(point, laterality) for name, point in mr_landmarks(inputs).items()}


def _joined(parts: Sequence[Fields], per_view: Sequence[Artefact]) -> Fields:
    """All predictions in one; the first view that failed gives its status, so that the case is named."""
    return Fields(
        arrays={name: array for part in parts for name, array in part.arrays.items()},
        volumes={name: volume for part in parts for name, volume in part.volumes.items()},
        values={name: value for part in parts for name, value in part.values.items()},
        failure=next((artefact.failure for artefact in per_view if artefact.failure), None),
    )


def without_result(inputs: Inputs, failure: Failure) -> dict[str, Value]:
    """Rows without numbers of all that is marked, with what went wrong; marks that cannot be read have none."""
    message = str(failure)
    landmarks = _readable(lambda: mr_landmarks(inputs))
    views = lost_views(inputs.artefacts("pose"), message)
    names_of = {view: _readable(partial(view_lesion_names, inputs, view)) for view in views.imaged}
    second = "mr_compressed" in inputs.artefact("segment").inputs
    return {
        "mammogram_rows": missing_in_mammograms(views, [*_readable(lambda: mr_lesion_names(inputs)), *landmarks]),
        "mr_rows": missing_in_mr(names_of, message),
        "compressed_rows": missing_in_compressed(landmarks, message) if second else [],
    }


def _readable(names: Callable[[], Iterable[str]]) -> list[str]:
    try:
        return list(names())
    except (DataError, OSError):
        return []


STAGE = Stage(
    name="localize",
    schema=1,
    inputs=("segment", "mesh"),
    optional=(
        "pose",
        "compress",
        "solve",
        "mr_lesion",
        "mr_landmarks",
        "lesion_CC",
        "lesion_MLO",
    ),
    settings=Settings,
    run=run,
    takes_failed=True,
    without_result=without_result,
)
