"""The views of a case with the methods that each offers, and why a method is missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mammoreg.localization.deformation import MethodView, ReferenceMesh
from stages.engine.artefact import Artefact
from stages.methods import MESH_METHODS, METHODS, method_views
from stages.pose.record import PoseRecord
from stages.views import IMAGED, view_order


@dataclass(frozen=True)
class CaseViews:
    """What `localize` works with, by view name, CC first.

    Attributes:
        poses: of those that ended well.
        methods: what each view of `poses` offers, by method.
        troubles: (view, method) -> why it is missing.
    """

    poses: Mapping[str, PoseRecord]
    methods: Mapping[str, Mapping[str, MethodView]]
    troubles: Mapping[tuple[str, str], str]

    @property
    def imaged(self) -> list[str]:
        """Views with a mammogram, those among them whose pose failed."""
        return [view for view in IMAGED if view in self.poses or (view, METHODS[0]) in self.troubles]


def case_views(poses: Sequence[Artefact], solutions: Sequence[Artefact], reference: ReferenceMesh) -> CaseViews:
    """Collect the views of a case.

    Args:
        poses: artefacts of `pose`, failed ones too.
        solutions: artefacts of `compress` and `solve`, failed ones too.
        reference: the undeformed mesh.
    """
    ordered = sorted(poses, key=lambda pose: view_order(str(pose.view)))
    well = {str(pose.view): PoseRecord(pose) for pose in ordered if pose.ok}
    methods = {view: method_views(pose, reference, solutions) for view, pose in well.items()}
    troubles = {(str(pose.view), method): pose.message for pose in ordered if not pose.ok for method in METHODS}
    for view, offered in methods.items():
        for method in (m for m in METHODS if m not in offered):
            troubles[view, method] = _reason(view, method, solutions)
    return CaseViews(well, methods, troubles)


def lost_views(poses: Sequence[Artefact], message: str) -> CaseViews:
    """The views of a case in which nothing could be predicted, all for one reason."""
    return CaseViews({}, {}, {(str(pose.view), method): message for pose in poses for method in METHODS})


def _reason(view: str, method: str, solutions: Sequence[Artefact]) -> str:
    stage = MESH_METHODS.get(method, "pose")
    failed = [s.message for s in solutions if s.view == view and s.stage == stage and not s.ok]
    return failed[0] if failed else f"no result of {stage}"
