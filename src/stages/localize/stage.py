"""Stage `localize`: where each side shows what the other marks. The three directions share no marks."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import chain

from mammoreg.arrays import Points
from mammoreg.errors import DataError
from mammoreg.geometry import lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.meshing.block import BlockMesh
from stages.annotations import mr_landmarks, mr_lesion_names, mr_lesions, view_areas, view_lesion_names
from stages.engine.artefact import Artefact, Fields
from stages.engine.completion import first_failure
from stages.engine.contract import Failure, Inputs, NoSettings, Stage, Subject, Value
from stages.localize.record import compressed_fields, mammogram_fields, mr_fields
from stages.localize.strays import Stray, filling, strays_in_mammogram, strays_in_mr
from stages.localize.to_compressed import missing_in_compressed, predict_in_compressed
from stages.localize.to_mammogram import missing_in_mammograms, predict_in_mammograms
from stages.localize.to_mr import UndeformedBreast, missing_in_mr, predict_in_mr
from stages.localize.views import CaseViews, case_views, lost_views
from stages.mesh.record import MeshRecord
from stages.second_volume import second_volume
from stages.segment.record import SegmentRecord
from stages.views import IMAGED

_SKIN_PARTS = 6


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Predict in every direction for which the case has marks; what a failed view lacks is a row with its message."""
    required = [inputs.artefact(name) for name in ("segment", "mesh")]
    if failure := first_failure(required):
        return Fields(values=without_result(inputs, failure), failure=failure)
    segment, mesh = SegmentRecord(required[0]), MeshRecord(required[1])
    per_view = [a for name in ("pose", "compress", "solve") for a in inputs.artefacts(name)]
    poses = [a for a in per_view if a.stage == "pose"]
    solutions = [a for a in per_view if a.stage != "pose"]
    views = case_views(poses, solutions, mesh.reference)
    parts = [
        _to_mammograms(inputs, views, segment),
        _to_mr(inputs, views, segment, mesh.block.skin_points(_SKIN_PARTS)),
        _to_compressed(inputs, views, segment, mesh.block),
    ]
    return _joined(parts, per_view)


def _to_mammograms(inputs: Inputs, views: CaseViews, segment: SegmentRecord) -> Fields:
    """Reads `mr_lesion` and `mr_landmarks` alone."""
    laterality = segment.laterality
    lesions = {name: lesion.to_breast(laterality) for name, lesion in mr_lesions(inputs).items()}
    landmarks, breast = _landmarks(inputs, laterality), segment.breast_mask
    strays = _strays({name: lesion.centre for name, lesion in lesions.items()} | landmarks, segment)
    strays |= filling(lesions, breast)
    bodies = {name: lesion.body() for name, lesion in lesions.items()}
    return predict_in_mammograms(views, bodies, landmarks, strays)


def _to_mr(inputs: Inputs, views: CaseViews, segment: SegmentRecord, skin: Points) -> Fields:
    """Reads the views' `lesion` alone."""
    anatomy = UndeformedBreast(segment.laterality, segment.breast_mask, segment.nipple, skin, segment.chest_wall)
    names_of = {view: view_lesion_names(inputs, view) for view in views.imaged}
    areas = {view: view_areas(inputs, pose) for view, pose in views.poses.items()}
    strays = {view: strays_in_mammogram(areas[view], pose) for view, pose in views.poses.items() if pose.has_mammogram}
    return predict_in_mr(views, anatomy, names_of, areas, strays)


def _to_compressed(inputs: Inputs, views: CaseViews, segment: SegmentRecord, block: BlockMesh) -> Fields:
    """Reads `mr_landmarks` and the mask of the second volume alone."""
    second = second_volume(segment, block)
    if second is None:
        return Fields()
    landmarks = _landmarks(inputs, segment.laterality)
    return predict_in_compressed(views, second, landmarks, segment.laterality, _strays(landmarks, segment))


def _strays(points: dict[str, Points], segment: SegmentRecord) -> dict[str, Stray]:
    return strays_in_mr(points, segment.breast_mask, segment.labels, segment.laterality)


def _landmarks(inputs: Inputs, laterality: Laterality) -> dict[str, Points]:
    return {name: lps_to_breast(point, laterality) for name, point in mr_landmarks(inputs).items()}


def _joined(parts: Sequence[Fields], per_view: Sequence[Artefact]) -> Fields:
    """All predictions in one; the first view that failed gives its status, so that the case is named."""
    return Fields(
        arrays={name: array for part in parts for name, array in part.arrays.items()},
        volumes={name: volume for part in parts for name, volume in part.volumes.items()},
        values={name: value for part in parts for name, value in part.values.items()},
        failure=first_failure(per_view),
    )


def without_result(inputs: Inputs, failure: Failure) -> dict[str, Value]:
    """Rows without numbers of all that is marked, with what went wrong; marks that cannot be read have none."""
    message = str(failure)
    lesions, landmarks = _readable(lambda: mr_lesion_names(inputs)), _readable(lambda: mr_landmarks(inputs))
    views = lost_views(inputs.artefacts("pose"), message)
    names_of = {view: _readable(partial(view_lesion_names, inputs, view)) for view in views.imaged}
    second = "mr_compressed" in inputs.artefact("segment").inputs
    parts = (
        mammogram_fields(missing_in_mammograms(views, [*lesions, *landmarks]), [], lesions),
        mr_fields(missing_in_mr(names_of, message), [], list(dict.fromkeys(chain.from_iterable(names_of.values())))),
        compressed_fields(missing_in_compressed(landmarks, message) if second else []),
    )
    return {name: value for part in parts for name, value in part.values.items()}


def _readable(names: Callable[[], Iterable[str]]) -> list[str]:
    try:
        return list(names())
    except (DataError, OSError):
        return []


STAGE = Stage(
    name="localize",
    schema=2,
    inputs=("segment", "mesh"),
    optional=(
        "pose",
        "compress",
        "solve",
        "mr_lesion",
        "mr_landmarks",
        *(f"lesion_{view}" for view in IMAGED),
    ),
    settings=NoSettings,
    run=run,
    takes_failed=True,
    without_result=without_result,
)
