"""Registration of a breast's MR volume with its mammograms, on arrays: what the package offers at its top.

All points and volumes that go in or come out are DICOM patient coordinates (LPS, mm); pixels are (column, row) of the
image as it is stored, counted from the centre of the first one. The same functions run in the stages of the workflow.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mammoreg.arrays import Points
from mammoreg.breast.compression import Compression, prepare_compression
from mammoreg.breast.interior import plates_around, solve_interior
from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.errors import DataError, NotConvergedError
from mammoreg.fem.plates.closing import Closed
from mammoreg.geometry import ViewGeometry, Volume, breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.acquisition import Mammogram
from mammoreg.imaging.mr_segment import BiasField, SegmentSettings, no_bias, segment_volume
from mammoreg.localization.deformation import MeshDeformation, MethodView, ReferenceMesh
from mammoreg.localization.grid import BreastGrid, BreastInView
from mammoreg.localization.lesions import LesionArea, area_from_disc, area_from_mask
from mammoreg.localization.to_mammogram import project_landmarks
from mammoreg.localization.to_mr import centre_curve, locate_in_breast
from mammoreg.materials.cube import HIGH_COMPRESSION, SULLIVAN, mu_for_force_kpa
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.breast import build_mesh
from mammoreg.meshing.fractions import gland_fraction
from mammoreg.metrics.distances import breast_scale_mm
from mammoreg.pose.dense_tissue import dense_tissue
from mammoreg.pose.outlined import OutlinedMammogram, outlined_mammograms
from mammoreg.pose.row_order import pose_in_order
from mammoreg.pose.search import PoseSearch, find_pose
from mammoreg.shape.surface import ShapeOptions, drawn_surface

ELEMENTS = 7
"""Hexahedra a side (paper, section II-A)."""


@dataclass(frozen=True, eq=False)
class Breast:
    """The undeformed breast of an MR volume, meshed; made by `Breast.of_mr`.

    Attributes:
        laterality: L or R.
        labels: tissue of each voxel by the codes of `mammoreg.labels`, breast frame.
        mask: the breast in front of the chest wall, breast frame.
        nipple: (3,), breast frame, mm.
        mesh: hexahedra, breast frame.
        back_layer_mm: soft tissue between its back and the pectoral muscle, for `BreastMechanics`; None where it does
            not show.
    """

    laterality: Laterality
    labels: Volume
    mask: Volume
    nipple: Points
    mesh: BlockMesh
    back_layer_mm: float | None = None

    @classmethod
    def of_mr(
        cls,
        mr: Volume,
        laterality: Laterality,
        labels: Volume | None = None,
        elements: int = ELEMENTS,
        settings: SegmentSettings | None = None,
        bias_field: BiasField = no_bias,
    ) -> "Breast":
        """Segment and mesh one breast.

        Args:
            mr: intensities of an undeformed MR volume, LPS, of one breast or both; `mammoreg.volume_of_affine` makes
                it of an array.
            laterality: the breast, L or R.
            labels: tissues on the same grid instead of the automatic segmentation.
            elements: hexahedra a side, at least 3.
            settings: of the segmentation.
            bias_field: estimates the coil's inhomogeneity (the workflow's is N4); none by default.

        Raises:
            ValueError: a volume is not in LPS.
            DataError: no usable breast.
            NotConvergedError: an element stays inverted.
        """
        settings = settings if settings is not None else SegmentSettings()
        given = None if labels is None else labels.to_breast(laterality)
        found = segment_volume(mr.to_breast(laterality), given, settings, bias_field)
        mask = found.mr.with_data(found.breast.astype(np.uint8))
        mesh = build_mesh(mask, found.back, found.nipple, elements).mesh
        labelled = found.mr.with_data(found.labels)
        return cls(laterality, labelled, mask, found.nipple, mesh, found.muscle.layer_mm)

    @cached_property
    def reference(self) -> ReferenceMesh:
        """The mesh, ready to carry points."""
        return ReferenceMesh(self.mesh.points, self.mesh.hexes())

    @cached_property
    def grid(self) -> BreastGrid:
        """The voxels, ready to be looked up from a mammogram."""
        return BreastGrid(self.mask)

    @cached_property
    def gland(self) -> NDArray[np.float64]:
        """Fraction (E,) of gland in each element."""
        return gland_fraction(self.mesh, self.labels)


@dataclass(frozen=True, eq=False)
class RegisteredView:
    """A mammogram registered with the breast's MR volume.

    Attributes:
        breast: of the MR volume.
        mammogram: as it was analysed.
        method: the deformation and the geometry of the view.
        closed: the breast between the plates before its outline was met, with forces and report.
        doubts: what speaks against the order of rows in which an image without orientation was taken, in words.
    """

    breast: Breast
    mammogram: OutlinedMammogram
    method: MethodView
    closed: Closed
    doubts: tuple[str, ...] = ()

    @property
    def geometry(self) -> ViewGeometry:
        """Angle, plates, source and detector as they were found."""
        return self.method.geometry

    def to_mammogram(self, points: ArrayLike) -> NDArray[np.float64]:
        """Where the mammogram shows points (N, 3) of the MR volume, LPS, mm.

        Returns:
            pixels (N, 2) as (column, row) of the stored image; nan where a point lies outside its imaged part.
        """
        places = lps_to_breast(np.asarray(points, dtype=float).reshape(-1, 3), self.breast.laterality)
        pixels, seen = project_landmarks(self.method, places)
        return np.where(seen[:, None], self._flipped(pixels), np.nan)

    def to_mr(self, pixel: ArrayLike) -> Points:
        """The beam to a pixel (column, row) of the stored image, carried back into the undeformed breast.

        Returns:
            points (N, 3), LPS, mm, from the support to the source: one view tells a curve, not a depth on it. Where
            the beam misses the breast it is the breast's nearest part.
        """
        curve, _ = centre_curve(self._on_grid(), self._flipped(np.asarray(pixel, dtype=float)))
        return breast_to_lps(curve, self.breast.laterality)

    def mark(self, pixel: ArrayLike, diameter_mm: float) -> "Mark":
        """A lesion in the mammogram as a disc about a pixel (column, row), its diameter measured in the breast."""
        column, row = self._flipped(np.asarray(pixel, dtype=float))
        disc = area_from_disc(float(column), float(row), diameter_mm / breast_scale_mm(self.geometry))
        return Mark(self, disc)

    def mark_mask(self, mask: NDArray[Any]) -> "Mark":
        """A lesion in the mammogram as a mask (rows, columns), non-zero inside, of the stored image."""
        if mask.shape != (self.geometry.rows, self.geometry.columns):
            raise DataError(f"a mask of shape {mask.shape} does not fit a mammogram of another size")
        return Mark(self, area_from_mask(self.mammogram.image.flips.apply(mask != 0)))

    def _flipped(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Between stored and canonical pixels (..., 2), both ways."""
        return self.mammogram.image.flips.apply_to_pixels(pixels, (self.geometry.rows, self.geometry.columns))

    def _on_grid(self) -> BreastInView:
        return BreastInView(self.method, self.breast.grid)


@dataclass(frozen=True, eq=False)
class Mark:
    """A lesion marked in a registered view, as an area of its canonical image."""

    view: RegisteredView
    area: LesionArea


@dataclass(frozen=True)
class Located:
    """A lesion of the mammograms in the MR volume, LPS, mm.

    Attributes:
        point: its centre (3,); of one view the middle of its curve, which can be far from the lesion.
        region: where the back-projected areas meet; None if they do not.
        curves: of each view the beam through the lesion's centre, carried back, points (N, 3).
        beam_gap_mm: distance of two curves where they come closest; None for one view.
        message: empty, or what a reader must know of it.
    """

    point: Points
    region: Volume | None
    curves: tuple[Points, ...]
    beam_gap_mm: float | None
    message: str


def register(
    breast: Breast,
    mammogram: Mammogram,
    mechanics: BreastMechanics | None = None,
    mu_kpa: float | None = None,
    search: PoseSearch | None = None,
) -> RegisteredView:
    """Register a mammogram with the MR volume of the same breast: seek the pose, close the plates, meet the outline.

    Args:
        breast: of the MR volume.
        mammogram: a view of it.
        mechanics: tissue, plates and back; the workflow's by default.
        mu_kpa: mean shear modulus of the tissue; by default scaled to the force measured in mammography.
        search: how the projection angle is sought.

    Raises:
        DataError: the image shows no usable breast, or its thickness is no compression of this one.
        NotConvergedError: with the reason.
    """
    mechanics = mechanics if mechanics is not None else BreastMechanics()
    mu_kpa = mu_kpa if mu_kpa is not None else mu_for_force_kpa(SULLIVAN.median_n, HIGH_COMPRESSION)
    orders = outlined_mammograms(mammogram, breast.laterality)
    tissue = dense_tissue(breast.labels, breast.mask, breast.mesh)
    how = search if search is not None else PoseSearch()
    find = partial(find_pose, mesh=breast.mesh, mechanics=mechanics, mu_kpa=mu_kpa, tissue=tissue, search=how)
    posed = pose_in_order(orders, find, breast.laterality, mammogram.view)
    seen, pose = orders[posed.chosen], posed.found
    if pose.estimate is None:
        raise NotConvergedError("the coarse compression converged at none of the angles tried, so the pose is unknown")
    view = pose.estimate.view
    gland = breast.gland if mechanics.tells_gland_from_fat else None
    prepared = prepare_compression(breast.mesh, view, mechanics, mu_kpa, gland)
    closed = prepared.closing.close(view.thickness_mm)
    deformed = _between_plates(breast.mesh, prepared, closed, view, seen)
    return RegisteredView(
        breast, seen, MethodView(MeshDeformation(breast.reference, deformed), view), closed, posed.doubts
    )


def _between_plates(
    mesh: BlockMesh, prepared: Compression, closed: Closed, view: ViewGeometry, seen: OutlinedMammogram
) -> Points:
    """Nodes (N, 3), plate frame, of the breast whose silhouette meets the outline."""
    # The solver's plates stand where the breast takes them, the view's where the image has seen them.
    floating = replace(view, height_mm=closed.height_mm)
    ratio = prepared.breast.stiffness_ratio
    drawn = drawn_surface(mesh, prepared.closing, closed, floating, seen.view.outline, ratio, ShapeOptions())
    state = drawn.closed.state
    plates = plates_around(mesh, prepared.breast, prepared.closing, closed.gap_mm, closed.state.height, state.memory)
    solved = solve_interior(prepared.breast, plates, drawn.nodes, drawn.surface, drawn.closed.deformed, state.pressure)
    return np.asarray(solved.deformed + np.array([0.0, 0.0, view.height_mm - closed.height_mm]))


def locate(marks: Sequence[Mark]) -> Located:
    """Locate in the MR volume a lesion that is marked in one or two registered views.

    Args:
        marks: the same lesion in views of one `Breast`, made by `RegisteredView.mark` or `mark_mask`.

    Raises:
        ValueError: no mark, or views of different breasts.
    """
    if not marks or any(mark.view.breast is not marks[0].view.breast for mark in marks):
        raise ValueError("locate needs marks in views that were registered with one and the same Breast")
    side = marks[0].view.breast.laterality
    names = [str(number) for number in range(len(marks))]
    found = locate_in_breast(
        {name: mark.view._on_grid() for name, mark in zip(names, marks, strict=True)},
        {name: mark.area for name, mark in zip(names, marks, strict=True)},
    )
    return Located(
        breast_to_lps(found.point, side),
        None if found.region is None else found.region.to_lps(side),
        tuple(breast_to_lps(found.curves[name], side) for name in names),
        found.beam_gap_mm,
        found.message,
    )
