"""Outlines, mesh and segmentation of a case as pictures."""

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, breast_to_plate, lps_to_breast
from mammoreg.labels import Label
from mammoreg.meshing.locate import Locator
from mammoreg.plots.mesh3d import PlatesPicture, deformed_meshes
from mammoreg.plots.outlines import ViewOutlines, outlines_before_and_after
from mammoreg.plots.style import Png
from mammoreg.plots.tissues import segmentation
from mammoreg.pose.silhouette import detector_mm
from stages.figures.case import BEST_FIRST, PicturedCase, first_of
from stages.figures.images import mammogram
from stages.methods import MESH_METHODS
from stages.pose.record import FINE_RAYS
from stages.segment.record import SegmentRecord


def outlines(case: PicturedCase) -> Png | None:
    """The image's outline and the silhouette of every method, per view."""
    # A case with nothing but its share of compression has a pose without an image.
    outlined = [view for view, pose in case.poses.items() if pose.has_outline]
    if case.block is None or not outlined:
        return None
    return outlines_before_and_after([_view_outlines(case, view) for view in outlined], case.breast)


def _view_outlines(case: PicturedCase, view: str) -> ViewOutlines:
    assert case.block is not None
    pose = case.poses[view]
    outline = pose.outline(FINE_RAYS)
    models = {}
    for name, way in case.methods[view].items():
        projected = detector_mm(way.deformation.forward(case.block.points), way.geometry)
        models[name] = outline.of_model(projected, case.block.skin_quads()).points()
    return ViewOutlines(view, mammogram(pose), outline.points(), outline.weight, models)


def meshes(case: PicturedCase) -> Png | None:
    """The mesh before and between the plates, per view that has a solution."""
    pictures = [picture for view in case.poses if (picture := _between_plates(case, view)) is not None]
    return deformed_meshes(pictures, case.breast) if pictures else None


def _between_plates(case: PicturedCase, view: str) -> PlatesPicture | None:
    methods = case.methods.get(view, {})
    best = first_of([name for name in BEST_FIRST if name in MESH_METHODS], methods)
    if best is None or case.block is None:
        return None
    geometry = methods[best].geometry
    undeformed = breast_to_plate(case.block.points, geometry.angle_deg)
    deformed = methods[best].deformation.forward(case.block.points)
    plates = (geometry.height_mm, geometry.thickness_mm, geometry.edge_p_mm)
    return PlatesPicture(view, undeformed, deformed, case.block.skin_quads(), *plates)


def tissues(case: PicturedCase) -> Png | None:
    """Breast, gland and mesh in slices through the nipple."""
    segment = case.segment
    if segment is None:
        return None
    breast, labels = segment.breast_mask_lps, segment.labels_lps
    gland = labels.with_data((labels.data == Label.GLAND) & (breast.data != 0))
    nipple = segment.nipple_lps
    return segmentation(segment.mr_lps, breast, gland, _mesh_mask(case, segment, nipple), nipple, case.breast)


def _mesh_mask(case: PicturedCase, segment: SegmentRecord, nipple: Points) -> Volume | None:
    """Voxels inside the mesh, on the two slices through the nipple alone."""
    if case.block is None:
        return None
    grid = segment.breast_mask_lps
    index = np.clip(np.rint(grid.to_index(nipple)).astype(int), 0, np.array(grid.shape) - 1)
    shown = np.zeros(grid.shape, dtype=bool)
    shown[index[0]] = True
    shown[:, :, index[2]] = True
    _, _, inside = Locator(case.block.points, case.block.hexes()).locate(
        lps_to_breast(grid.centres(shown), case.laterality)
    )
    mask = np.zeros(grid.shape, dtype=bool)
    mask[shown] = inside
    return grid.with_data(mask)
