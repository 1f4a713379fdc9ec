"""Files of a case that other programs open (3D Slicer, ParaView), by name inside its folder `export`."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.geometry import Volume, breast_to_lps, lps_to_breast, plate_to_breast
from mammoreg.geometry.frames import Laterality, plate_rotation
from mammoreg.meshing.block import BlockMesh
from stages.compress.record import GLAND_SHARE, CompressRecord
from stages.figures.case import PicturedCase
from stages.formats.files import mask_png, mr_grid, nifti_bytes, on_grid, volume_affine, vtu_bytes
from stages.mesh.record import lps_hexes
from stages.methods import MESH_METHODS

_DISPLACEMENT_INTENT = 1006
_OUTSIDE_MM = 0.0
README = """Research use only.

Coordinates inside the files follow each format's habit (NIfTI: RAS; VTU: LPS), all in mm.

lesion_<n>_<method>_mr.nii.gz      lesion predicted from the mammograms, on the voxels of the MR volume as given
lesion_<n>_<method>_<view>.png     lesion predicted from the MR volume, in the mammogram's pixels as stored
mr_<view>_<method>.nii.gz          MR volume as deformed between the plates of a view
displacement_<view>_<method>.nii.gz  displacement of each voxel of the undeformed breast, zero outside it
mesh.vtu, mesh_<view>_<method>.vtu undeformed and deformed mesh
lesions.tsv                        names of the lesions <n>, as marked in the MR volume (mr) and in the mammograms
"""


def case_exports(case: PicturedCase) -> dict[str, bytes]:
    """All files of a case as far as its stages came.

    Returns:
        Contents by file name; empty where not even the mesh exists.
    """
    block = case.block
    if block is None:
        return {}
    files = {"README.txt": README.encode(), "mesh.vtu": _undeformed_mesh(case, block)}
    files |= _lesion_names(case) | _lesions_in_mr(case) | _lesions_in_mammograms(case)
    solved = {view: [m for m in MESH_METHODS if m in case.methods[view]] for view in case.poses}
    for view, methods in solved.items():
        files |= {f"mesh_{view}_{method}.vtu": _deformed_mesh(case, block, view, method) for method in methods}
    best = {view: methods[-1] for view, methods in solved.items() if methods}
    return files | _deformed_volumes(case, best) | _displacements(case, best)


def plate_to_lps_affine(angle_deg: float, laterality: Laterality) -> NDArray[np.float64]:
    """The plate frame to LPS, (4, 4)."""
    affine = np.eye(4)
    affine[:3, :3] = plate_rotation(angle_deg).T
    if laterality == "L":
        affine[0] *= -1.0
    return affine


def _deformed_volumes(case: PicturedCase, methods: Mapping[str, str]) -> dict[str, bytes]:
    """The MR volume between the plates, by one method per view."""
    files = {}
    for view, method in methods.items():
        projected = case.projection(view)
        volume = None if projected is None else projected.deformed_mr(method)
        if volume is not None:
            turned = plate_to_lps_affine(case.methods[view][method].geometry.angle_deg, case.laterality)
            data = volume.data.astype(np.float32)
            files[f"mr_{view}_{method}.nii.gz"] = nifti_bytes(data, turned @ volume_affine(volume))
    return files


def _displacements(case: PicturedCase, methods: Mapping[str, str]) -> dict[str, bytes]:
    """Displacement fields one after the other: the mesh remembers where the breast's voxels lie."""
    segment = case.segment
    files: dict[str, bytes] = {}
    if segment is None:
        return files
    grid = segment.breast_mask_lps
    for view, method in methods.items():
        # NIfTI keeps the three components in its fifth axis, in its own RAS directions.
        field = displacement_field(case, view, method, grid) * [-1.0, -1.0, 1.0]
        ras = field.astype(np.float32)[:, :, :, None]
        name = f"displacement_{view}_{method}.nii.gz"
        files[name] = nifti_bytes(ras, volume_affine(grid), _DISPLACEMENT_INTENT)
    return files


def displacement_field(case: PicturedCase, view: str, method: str, breast: Volume) -> NDArray[np.float64]:
    """Displacement of the breast's voxels in LPS, (nx, ny, nz, 3), mm; zero outside the breast."""
    mask = breast.data != 0
    points = breast.centres(mask)
    field = np.full((*breast.shape, 3), _OUTSIDE_MM)
    field[mask] = _carried(case, view, method, points) - points
    return field


def _carried(case: PicturedCase, view: str, method: str, points: Points) -> Points:
    """Points (N, 3) of the undeformed breast between the plates of a view, both LPS mm."""
    way = case.methods[view][method]
    placed = way.deformation.forward(lps_to_breast(points, case.laterality))
    return breast_to_lps(plate_to_breast(placed, way.geometry.angle_deg), case.laterality)


def _undeformed_mesh(case: PicturedCase, block: BlockMesh) -> bytes:
    """The undeformed mesh, LPS, with the share of gland in each element where a material asked for it."""
    compress = case.ok("compress")
    gland = None if compress is None else CompressRecord(compress).gland_share
    shares = {} if gland is None else {GLAND_SHARE: [gland]}
    return vtu_bytes(breast_to_lps(block.points, case.laterality), lps_hexes(block, case.laterality), {}, shares)


def _deformed_mesh(case: PicturedCase, block: BlockMesh, view: str, method: str) -> bytes:
    """The deformed mesh, LPS, with the displacement of its nodes."""
    points = breast_to_lps(block.points, case.laterality)
    carried = _carried(case, view, method, points)
    return vtu_bytes(carried, lps_hexes(block, case.laterality), {"displacement_mm": carried - points}, {})


def _lesion_names(case: PicturedCase) -> dict[str, bytes]:
    """Which lesion each number stands for."""
    marked = {"mr": case.mr_lesions, "mammograms": case.mammogram_lesions}
    lines = [f"{where}\t{number}\t{name}" for where, names in marked.items() for number, name in enumerate(names)]
    return {"lesions.tsv": "\n".join(["marked_in\tn\tname", *lines, ""]).encode()} if lines else {}


def _lesions_in_mr(case: PicturedCase) -> dict[str, bytes]:
    """Regions in the MR volume, on the voxels of the volume that the user gave."""
    path, predictions = case.inputs.path("mr"), case.predictions
    if path is None or predictions is None or not case.mammogram_lesions:
        return {}
    shape, affine = mr_grid(path)
    files = {}
    for number, name in enumerate(case.mammogram_lesions):
        for method in sorted({method for view in case.imaged for method in case.methods[view]}):
            region = predictions.region(method, name)
            if region is not None:
                mask = on_grid(region, shape, affine)
                files[f"lesion_{number}_{method}_mr.nii.gz"] = nifti_bytes(mask, affine)
    return files


def _lesions_in_mammograms(case: PicturedCase) -> dict[str, bytes]:
    """Predicted lesions as pictures of the stored mammogram's size."""
    files: dict[str, bytes] = {}
    predictions = case.predictions
    if predictions is None:
        return files
    for view, pose in case.imaged.items():
        for method in sorted(case.methods[view]):
            for number, name in enumerate(case.mr_lesions):
                area = predictions.area(view, method, name)
                if area is not None:
                    canonical = area.on_image(pose.geometry.rows, pose.geometry.columns)
                    files[f"lesion_{number}_{method}_{view}.png"] = mask_png(pose.stored_image(canonical))
    return files
