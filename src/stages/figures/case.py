"""What pictures and exports need of a case, read once and in spite of stages that failed."""

from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cached_property

from mammoreg.geometry.frames import Laterality
from mammoreg.localization.deformation import MethodView, ReferenceMesh
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Artefact
from stages.engine.contract import Inputs
from stages.evaluate.predictions import Predictions
from stages.methods import METHODS, block_mesh, method_views

IMAGED = ("CC", "MLO")
BEST_FIRST = tuple(reversed(METHODS))


@dataclass(frozen=True)
class PicturedCase:
    """A case as far as its stages came; what is missing is None or empty."""

    inputs: Inputs
    laterality: Laterality

    def ok(self, name: str) -> Artefact | None:
        """The artefact of a stage that ended well."""
        found = [artefact for artefact in self.inputs.artefacts(name) if artefact.ok]
        return found[0] if found else None

    @cached_property
    def predictions(self) -> Predictions | None:
        """Predictions of `localize`, also of one whose status is not ok; None for a case without any view."""
        return Predictions(self.inputs.artefact("localize")) if self.inputs.has("localize") else None

    @cached_property
    def mr_lesions(self) -> list[str]:
        """Names of the lesions marked in the MR volume."""
        return self._listed("mr_lesion_names")

    @cached_property
    def mammogram_lesions(self) -> list[str]:
        """Names of the lesions marked in the mammograms."""
        return self._listed("mammogram_lesion_names")

    def _listed(self, name: str) -> list[str]:
        found = [a.value(name) for a in self.inputs.artefacts("localize") if a.has(name)]
        return list(found[0]) if found else []

    @cached_property
    def poses(self) -> dict[str, Artefact]:
        """Poses that ended well, by view, CC first."""
        found = [pose for pose in self.inputs.artefacts("pose") if pose.ok]
        return {str(pose.view): pose for pose in sorted(found, key=lambda pose: str(pose.view))}

    @cached_property
    def imaged(self) -> dict[str, Artefact]:
        """Poses of the views with a mammogram."""
        return {view: pose for view, pose in self.poses.items() if view in IMAGED}

    @cached_property
    def block(self) -> BlockMesh | None:
        """The undeformed mesh in the breast frame."""
        mesh = self.ok("mesh")
        return block_mesh(mesh) if mesh else None

    @cached_property
    def methods(self) -> dict[str, dict[str, MethodView]]:
        """Methods by view and name; none without a mesh."""
        if self.block is None:
            return {}
        reference = ReferenceMesh(self.block.points, self.block.hexes())
        solutions = [*self.inputs.artefacts("compress"), *self.inputs.artefacts("solve")]
        return {view: method_views(pose, reference, solutions) for view, pose in self.poses.items()}

    def projection(self, view: str) -> Artefact | None:
        """Artefact of `project` for a view; one whose solve failed still has the other methods."""
        found = [artefact for artefact in self.inputs.artefacts("project") if artefact.view == view]
        return found[0] if found else None


def first_of(wanted: Sequence[str], offered: Container[str]) -> str | None:
    """The first wanted name that is offered."""
    return next((name for name in wanted if name in offered), None)
