"""The breast between the plates in patient coordinates: meshes, volumes and displacement fields as files."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import breast_to_lps, lps_to_breast, plate_to_breast
from mammoreg.geometry.frames import plate_to_lps_affine
from mammoreg.localization.displacement import DisplacementField, MeshGrid
from mammoreg.meshing.block import BlockMesh
from stages.compress.record import GLAND_SHARE, CompressRecord
from stages.figures.case import PicturedCase
from stages.formats.itk_transform import displacement_transform
from stages.formats.nifti import displacement_nifti, nifti_bytes, volume_affine
from stages.formats.vtu import vtu_bytes
from stages.methods import MESH_METHODS

FORWARD, INVERSE = "forward", "inverse"
_FIELD_MM = 2.0
_MARGIN_MM = 8.0
_ROUNDED_MM = 1.0 / 64.0
"""Vectors are multiples of this, so that the files shrink to less than a half."""


@dataclass(frozen=True)
class DeformedBreast:
    """A case's mesh, undeformed and as each view and method deform it."""

    case: PicturedCase
    block: BlockMesh

    @cached_property
    def placings(self) -> dict[tuple[str, str], Points]:
        """By (view, method) of what can be placed: the shift (3,), LPS mm, from where the pose has it."""
        offered = [(view, m) for view in self.case.poses for m in MESH_METHODS if m in self.case.methods[view]]
        found = {pair: self.case.placing(*pair) for pair in offered}
        return {pair: shift for pair, shift in found.items() if shift is not None}

    @property
    def best(self) -> dict[str, str]:
        """The best method of each view."""
        return dict(self.placings.keys())

    def files(self) -> dict[str, bytes]:
        """Meshes by every method, volumes and fields by the best one of each view."""
        found = {"mesh.vtu": self._undeformed_mesh()}
        found |= {f"mesh_{view}_{method}.vtu": self._deformed_mesh(view, method) for view, method in self.placings}
        for view, method in self.best.items():
            found |= self._volume(view, method) | self._fields(view, method)
        return found

    def _deformed(self, view: str, method: str) -> Points:
        """Nodes between the plates, breast frame, mm."""
        way = self.case.methods[view][method]
        placed = plate_to_breast(way.deformation.forward(self.block.points), way.geometry.angle_deg)
        return placed + lps_to_breast(self.placings[view, method], self.case.laterality)

    def _undeformed_mesh(self) -> bytes:
        """The undeformed mesh with the share of gland in each element, where a material asked for it."""
        compress = self.case.ok("compress")
        gland = None if compress is None else CompressRecord(compress).gland_share
        return self._mesh(self.block.points, {}, {} if gland is None else {GLAND_SHARE: [gland]})

    def _deformed_mesh(self, view: str, method: str) -> bytes:
        """The deformed mesh with the displacement of its nodes."""
        carried = self._deformed(view, method)
        moved = breast_to_lps(carried - self.block.points, self.case.laterality)
        return self._mesh(carried, {"displacement_mm": moved}, {})

    def _mesh(
        self, points: Points, point_data: dict[str, Points], cell_data: dict[str, list[NDArray[np.float64]]]
    ) -> bytes:
        side = self.case.laterality
        return vtu_bytes(breast_to_lps(points, side), self.block.lps_hexes(side), point_data, cell_data)

    def _volume(self, view: str, method: str) -> dict[str, bytes]:
        """The MR volume between the plates."""
        projected = self.case.projection(view)
        volume = None if projected is None else projected.deformed_mr(method)
        if volume is None:
            return {}
        angle_deg = self.case.methods[view][method].geometry.angle_deg
        affine = plate_to_lps_affine(angle_deg, self.case.laterality) @ volume_affine(volume)
        affine[:3, 3] += self.placings[view, method]
        return {f"mr_{view}_{method}.nii.gz": nifti_bytes(volume.data.astype(np.float32), affine)}

    @cached_property
    def _grid(self) -> MeshGrid:
        return MeshGrid(self.block, _FIELD_MM, _MARGIN_MM)

    def _fields(self, view: str, method: str) -> dict[str, bytes]:
        """The displacement both ways, each as NIfTI with its mask and as an ITK transform."""
        deformed = self._deformed(view, method)
        back = MeshGrid(BlockMesh(self.block.n, deformed), _FIELD_MM, _MARGIN_MM)
        fields = {FORWARD: self._grid.displacement(deformed), INVERSE: back.displacement(self.block.points)}
        files: dict[str, bytes] = {}
        for way, field in fields.items():
            files |= self._field_files(f"displacement_{view}_{method}_{way}", field)
        return files

    def _field_files(self, name: str, field: DisplacementField) -> dict[str, bytes]:
        lps = field.to_lps(self.case.laterality)
        vectors = (np.round(lps.vectors / _ROUNDED_MM) * _ROUNDED_MM).astype(np.float32)
        affine = volume_affine(lps.inside)
        return {
            f"{name}.nii.gz": displacement_nifti(vectors, affine),
            f"{name}_mask.nii.gz": nifti_bytes(lps.inside.data, affine),
            f"{name}.h5": displacement_transform(vectors, lps.inside.origin, lps.inside.spacing),
        }
