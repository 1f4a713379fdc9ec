"""What pictures and exports need of a case, read once and in spite of stages that failed."""

from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import MethodView
from mammoreg.meshing.block import BlockMesh
from mammoreg.plots.style import PicturedBreast
from stages.engine.artefact import Artefact
from stages.engine.contract import Inputs
from stages.localize.record import Predictions
from stages.mesh.record import MeshRecord
from stages.methods import METHODS, method_views
from stages.pose.record import PoseRecord
from stages.project.record import ProjectRecord
from stages.segment.record import SegmentRecord
from stages.views import IMAGED, view_order

BEST_FIRST = tuple(reversed(METHODS))


@dataclass(frozen=True)
class PicturedCase:
    """A case as far as its stages came; what is missing is None or empty."""

    inputs: Inputs
    laterality: Laterality
    name: str = ""
    mr_series: str = ""

    @property
    def breast(self) -> PicturedBreast:
        """What every picture says of it."""
        return PicturedBreast(self.name, self.laterality)

    def ok(self, name: str) -> Artefact | None:
        """The artefact of a stage that ended well."""
        found = [artefact for artefact in self.inputs.artefacts(name) if artefact.ok]
        return found[0] if found else None

    @cached_property
    def predictions(self) -> Predictions | None:
        """Predictions of `localize`, also of one whose status is not ok; None for a case without any view."""
        return Predictions(self.inputs.artefact("localize")) if self.inputs.has("localize") else None

    @cached_property
    def segment(self) -> SegmentRecord | None:
        """The segmented breast, None if that failed."""
        found = self.ok("segment")
        return SegmentRecord(found) if found else None

    @cached_property
    def mr_lesions(self) -> list[str]:
        """Names of the lesions marked in the MR volume."""
        return self.predictions.mr_lesions if self.predictions else []

    @cached_property
    def mammogram_lesions(self) -> list[str]:
        """Names of the lesions marked in the mammograms."""
        return self.predictions.mammogram_lesions if self.predictions else []

    @cached_property
    def lesions(self) -> list[str]:
        """Names of all marked lesions, those of the MR volume first; one name is one lesion on both sides."""
        return list(dict.fromkeys([*self.mr_lesions, *self.mammogram_lesions]))

    @cached_property
    def poses(self) -> dict[str, PoseRecord]:
        """Poses that ended well, by view, CC first."""
        found = [PoseRecord(pose) for pose in self.inputs.artefacts("pose") if pose.ok]
        return {pose.view: pose for pose in sorted(found, key=lambda pose: view_order(pose.view))}

    @cached_property
    def imaged(self) -> dict[str, PoseRecord]:
        """Poses of the views with a mammogram."""
        return {view: pose for view, pose in self.poses.items() if view in IMAGED}

    @cached_property
    def mesh(self) -> MeshRecord | None:
        """The undeformed mesh, None if there is none."""
        found = self.ok("mesh")
        return MeshRecord(found) if found else None

    @property
    def block(self) -> BlockMesh | None:
        """The undeformed mesh in the breast frame."""
        return self.mesh.block if self.mesh else None

    @cached_property
    def methods(self) -> dict[str, dict[str, MethodView]]:
        """Methods by view and name; none without a mesh."""
        if self.mesh is None:
            return {}
        solutions = [*self.inputs.artefacts("compress"), *self.inputs.artefacts("solve")]
        return {view: method_views(pose, self.mesh.reference, solutions) for view, pose in self.poses.items()}

    @property
    def second_view(self) -> str | None:
        """The view whose compression a second MR volume shows; None without such a volume, or where it is unknown."""
        return self.predictions.compressed_view if self.predictions else None

    def placing(self, view: str, method: str) -> Points | None:
        """Shift (3,), LPS mm, from where a pose has the deformed breast to where it lies in the patient's coordinates.

        The second MR volume tells it for the view that it shows; None where it does and `localize` has left no answer.
        """
        if self.segment is None or self.segment.compressed_mask_lps is None:
            return np.zeros(3)
        if self.predictions is None or self.second_view is None:
            return None
        return self.predictions.placing(method) if view == self.second_view else np.zeros(3)

    def projection(self, view: str) -> ProjectRecord | None:
        """Projections of a view; one whose solve failed still has the other methods."""
        found = [artefact for artefact in self.inputs.artefacts("project") if artefact.view == view]
        return ProjectRecord(found[0]) if found else None


def first_of(wanted: Sequence[str], offered: Container[str]) -> str | None:
    """The first wanted name that is offered."""
    return next((name for name in wanted if name in offered), None)
