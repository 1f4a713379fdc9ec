"""The registration methods of a view as numerics see them, from what the stages left of it."""

from collections.abc import Sequence

from mammoreg.localization.deformation import MeshDeformation, MethodView, ReferenceMesh
from stages.engine.artefact import Artefact
from stages.pose.record import PoseRecord
from stages.solution import SolutionRecord

AFFINE_METHODS = ("rigid", "scaling")
MESH_METHODS = {"plate": "compress", "updated": "solve"}
METHODS = (*AFFINE_METHODS, *MESH_METHODS)
SHOWN_METHOD = "updated"
"""The full registration: what pages show, and what is believed."""


def of_view(artefacts: Sequence[Artefact], stage: str | None, view: str) -> Artefact | None:
    """The artefact of a stage and view, None if it was not given or did not end well."""
    found = [artefact for artefact in artefacts if (artefact.stage, artefact.view) == (stage, view) and artefact.ok]
    return found[0] if found else None


def method_views(pose: PoseRecord, reference: ReferenceMesh, solutions: Sequence[Artefact]) -> dict[str, MethodView]:
    """The methods that a view offers, by name.

    Args:
        pose: of the view.
        reference: the undeformed mesh.
        solutions: artefacts of `compress` and `solve`; a method whose solution is missing or failed is left out.
    """
    methods = {name: MethodView(pose.affine(name), pose.geometry_of(name)) for name in AFFINE_METHODS}
    for name, stage in MESH_METHODS.items():
        solution = of_view(solutions, stage, pose.view)
        if solution is not None:
            deformation = MeshDeformation(reference, SolutionRecord(solution).deformed)
            methods[name] = MethodView(deformation, pose.geometry_of(name))
    return methods
