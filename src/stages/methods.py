"""The registration methods of a view as numerics see them, built from artefacts; shared by later stages."""

from collections.abc import Sequence

import numpy as np

from mammoreg.geometry import ViewGeometry, lps_to_breast
from mammoreg.localization.deformation import AffineDeformation, MeshDeformation, MethodView, ReferenceMesh
from mammoreg.meshing.block import BlockMesh
from mammoreg.pose.outline import RadialOutline, radial_outline
from mammoreg.pose.silhouette import pixels_at_detector, ray_angles
from stages.engine.artefact import Artefact

AFFINE_METHODS = ("rigid", "scaling")
MESH_METHODS = {"plate": "compress", "updated": "solve"}
METHODS = (*AFFINE_METHODS, *MESH_METHODS)

OUTLINE_RAYS = 181
"""Rays on which a model is brought onto an outline."""
FINE_RAYS = 721
"""Rays on which results are measured and drawn."""

_OF_METHOD = ("angle_deg", "edge_p_mm", "middle_mm", "height_mm", "thickness_mm")
_OF_VIEW = ("source_detector_mm", "support_detector_mm", "pixel_mm")


def of_view(artefacts: Sequence[Artefact], view: str) -> Artefact | None:
    """The artefact of a view, None if it was not given or did not end well."""
    found = [artefact for artefact in artefacts if artefact.view == view and artefact.ok]
    return found[0] if found else None


def view_geometry(pose: Artefact, method: str | None = None) -> ViewGeometry:
    """Geometry of a view; `rigid` has its own angle and place, and parallel beams (contract, method `rigid`).

    The silhouette of a second volume, view 3D, is one of parallel beams for every method.
    """
    rigid = method == "rigid"
    parallel = rigid or pose.view == "3D"
    placed = {name: float(pose.value(f"rigid_{name}" if rigid else name)) for name in _OF_METHOD}
    shared = {name: float(pose.value(name)) for name in _OF_VIEW}
    rows, columns = int(pose.value("rows")), int(pose.value("columns"))
    return ViewGeometry(**placed, **shared, rows=rows, columns=columns, parallel=parallel)


def pose_outline(pose: Artefact, rays: int = OUTLINE_RAYS) -> RadialOutline:
    """The outline in a view's image on rays, mm at the detector."""
    points = pixels_at_detector(pose.array("outline", "px"), view_geometry(pose))
    return radial_outline(points, pose.array("outline_weight", "1"), ray_angles(rays))


def block_mesh(mesh: Artefact) -> BlockMesh:
    """The undeformed mesh in the breast frame."""
    return BlockMesh(int(mesh.value("n")), lps_to_breast(mesh.array("points", "mm"), mesh.laterality))


def reference_mesh(mesh: Artefact) -> ReferenceMesh:
    """The undeformed mesh in the breast frame, ready to carry points."""
    block = block_mesh(mesh)
    return ReferenceMesh(block.points, block.hexes())


def method_views(pose: Artefact, reference: ReferenceMesh, solutions: Sequence[Artefact]) -> dict[str, MethodView]:
    """The methods that a view offers, by name.

    Args:
        pose: of the view.
        reference: the undeformed mesh.
        solutions: artefacts of `compress` and `solve`; a method whose solution is missing or failed is left out.
    """
    methods = {}
    for name in AFFINE_METHODS:
        matrix, offset = pose.array(f"{name}_matrix", "1"), pose.array(f"{name}_offset", "mm")
        affine = AffineDeformation(np.asarray(matrix, dtype=float), np.asarray(offset, dtype=float))
        methods[name] = MethodView(affine, view_geometry(pose, name))
    for name, stage in MESH_METHODS.items():
        solution = of_view([s for s in solutions if s.stage == stage], str(pose.view))
        if solution is not None:
            deformed = np.asarray(solution.array("deformed", "mm"), dtype=float)
            methods[name] = MethodView(MeshDeformation(reference, deformed), view_geometry(pose, name))
    return methods
